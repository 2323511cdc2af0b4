"""The words that machines and people use for a column or a specimen's size, in the languages they use them in."""

import re
import unicodedata
from functools import cache

from matcal.readers.column_words import (
    GLUED,
    HEADS,
    LEADING,
    PREFERRED,
    QUALIFIERS,
    SCATTER,
    SHARED_HEADS,
    SYMBOLS,
    UNUSED,
)
from matcal.readers.dynamic_words import dynamic_of, is_compliance, modulus_of

# kinds of tests
KINDS = ("uniaxial", "biaxial", "planar", "shear", "volumetric", "relaxation", "creep", "dma", "conductivity")

_LATERAL = (
    ("lateral_stretch", r"(lateral|transverse) stretch( ratio)?|(lambda|λ) ?(2|lat|t|lateral|transverse)"),
    ("lateral", r"(lateral|transverse|transversal|radial|width|hoop) (nominal |engineering )?strain"
                r"|(eps|epsilon|ε) ?(2|lat|t|lateral|transverse)|querdehnung|deformation (transversale|laterale)"
                r"|deforma(cion|cao|zione) (transversale?|trasversale|lateral)|横向应变|橫向應變|横ひずみ"),
    ("deviation", r"(stress )?(std|std ?dev|standard deviation|sd|deviation)|(std|sd|standard deviation) (of )?stress"
                  r"|(stress|sigma|σ|p) (std|sd|err|error|uncertainty)|standardabweichung|ecart type|标准差"),
)

_SIZES = (
    ("diameter", r"diameter|diametro|diametre|durchmesser|(probe[n]?)durchmesser|直径|直徑"),
    ("width", r"width|breite|(probe[n]?)breite|largeur|ancho|larghezza|largura|szerokosc|sirka|bredd|宽度|宽|幅"),
    ("depth", r"depth|tiefe|profondeur|profundidad|深度"),
    ("thickness", r"thickness|dicke|(probe[n]?)dicke|epaisseur|espesor|spessore|espessura|grubosc|tloustka|tjocklek"
                  r"|厚度|厚"),
    ("height", r"height|anvil height|hohe|(probe[n]?)hohe|hauteur|altura|altezza|wysokosc|vyska|hojd|高度|高"),
    ("length", r"length|ga(u)?ge length|lange|(probe[n]?|mess)lange|longueur|longitud|lunghezza"
               r"|comprimento|dlugosc|delka|长度|标距|长"),
    ("area", r"area|(cross section|cross sectional|initial) area|(querschnitts)?flache|querschnitt|surface|section"
             r"|面积|横截面积"),
)
# letters of their own that no accent is taken off
_LETTERS = str.maketrans({"ł": "l", "ø": "o", "đ": "d", "ı": "i", "ß": "ss", "æ": "ae", "œ": "oe", "∆": "δ", "″": '"'})
# a share of the height that was given or that is left: where it begins tells
_COMPRESSION_RATIO = re.compile(r"(compress(ion|ive) ratio|rapporto di compressione)( .*)?")
# words that make a strain the logarithmic and a stress that over the area under load
_TRUE = re.compile(r"\b(true|log(arithmic)?|ln|hencky|cauchy|wahre?|vraie?|verdader[ao]|reale?)\b|真")


def true_quantity(name: str) -> str | None:
    """The quantity of a column name that calls it true (a logarithmic strain, a Cauchy stress), else None."""
    text, found = _TRUE.subn("", _plain(name))
    quantity = quantity_of(text) if found else None
    return quantity if quantity in ("strain", "stretch", "stress") else None


def is_compression_ratio(name: str) -> bool:
    """Whether a name may be that of a compressive strain or of the height over the height at rest."""
    return _COMPRESSION_RATIO.fullmatch(_plain(name)) is not None


def quantity_of(name: str) -> str | None:
    """The quantity that a column name (without its unit) stands for, or None."""
    return next(iter(quantities_of(name)), None)


@cache
def quantities_of(name: str) -> tuple[str, ...]:
    """All quantities that a column name may stand for, the usual one first: `Tension` is a stress or a voltage."""
    text = _plain(name)
    if _TRUE.search(text) or relative_of(name) is not None:
        return ()
    for quantity, pattern in _LATERAL:
        if re.fullmatch(pattern, text):
            return (quantity,)
    if re.fullmatch(SCATTER, text):
        return ()
    words = _words(text)
    for size in range(len(words), 0, -1):
        for start in range(len(words) - size + 1):
            behind = words[start + size:]
            found = _head(" ".join(words[start:start + size]))
            if found and not LEADING & set(behind) and all(word in _QUALIFIERS or re.fullmatch(r"\d", word)
                                                           for word in words[:start] + behind):
                return found
    return ()


def is_symbol(name: str) -> bool:
    """Whether a name is a letter, which other quantities have too, or a word that several quantities share."""
    return _plain(name) in SYMBOLS or len(quantities_of(name)) > 1


@cache
def unused_of(name: str) -> str | None:
    """What a column name stands for that is known and that no test uses (`a temperature`), or None."""
    text = _plain(name)
    return next((word for word, pattern in UNUSED if re.fullmatch(pattern, text)), None)


def relaxing_of(name: str) -> str | None:
    """`modulus` or `normalised` for the name of a modulus that relaxes, `compliance` for one that creeps, or None; a
    table of one has a time and no stress."""
    return "compliance" if is_compliance(_plain(name)) else modulus_of(_plain(name))


@cache
def relative_of(name: str) -> tuple[str, bool] | None:
    """(name of the quantity, whether only the change is given) of a ratio to an initial value: R/R0, sigma/sigma_0,
    ΔR/R0, (R-R0)/R0, relative resistance; None for any other name."""
    text = unicodedata.normalize("NFKC", name[:80]).strip().lower().translate(_LETTERS)
    ratio = r"(δ|delta ?|d)?[ _]?([^\W\d_]{1,14})[ _/:]{1,3}\2[ _]?\(?(?:0|o|init|initial|ref)\)?"
    if found := re.fullmatch(ratio, text) or re.fullmatch(r"(δ|delta ?|d)[ _]?([^\W\d_]{1,14}) ?/ ?\2", text):
        return found[2], found[1] is not None
    if found := re.fullmatch(r"\(?([^\W\d_]{1,14}) ?- ?\1[ _]?[0o]\)? ?/ ?\1[ _]?[0o]", text):
        return found[1], True
    words = r"(?:relative|rel\.?|normali[sz]ed|norm\.?|fractional)"
    if found := re.fullmatch(rf"(?:{words} )?(change (?:in |of )?)?(?:{words} )?resistance( change)?", text):
        changed = bool(found[1] or found[2])
        return ("r", changed) if text.startswith(("rel", "norm", "frac")) or changed else None
    return None


@cache
def dynamic_quantity(name: str) -> str | None:
    """The quantity of a dynamic test that a column name stands for (storage, loss, loss_tangent, frequency ...), or
    None; only tables that hold storage and loss are asked for these."""
    return dynamic_of(_plain(name))


def is_dynamic(names: tuple[str, ...]) -> bool:
    """Whether columns have a storage and a loss modulus, or one modulus and the loss tangent: a dynamic test (DMA)."""
    found = {dynamic_quantity(name) for name in names}
    return len(found & {"storage", "loss", "loss_tangent"}) > 1 or {"complex_modulus", "loss_tangent"} <= found


def size_of(name: str) -> str | None:
    """The size (a key of `recording.SIZES`) that the name of a property stands for, or None."""
    text = _plain(re.split(r"[:：]", name.rstrip(" :："))[-1])
    text = re.sub(r" (in|en) \w{1,4}$| ?[(\[][^()\[\]]*[)\]]$", "", text)
    text = re.sub(r" (?:[abdhl]|l[oe]|s|w)[ ]?[0o]?$", "", text)
    text = re.sub(r"^(?:(specimen|sample|initial|original|test piece|nominal) |试样|样品|试件)(?=\w)", "", text)
    return next((size for size, pattern in _SIZES if re.fullmatch(pattern, text)), None)


def preference(quantity: str, name: str) -> int:
    """Rank of a name among those of its quantity, 0 the first choice."""
    ranks = PREFERRED.get(quantity, ())
    return next((k for k, pattern in enumerate(ranks) if re.fullmatch(pattern, _plain(name))), len(ranks))


def _plain(name: str) -> str:
    """Lower case without accents, underscores, and the channel that a controller puts before a name."""
    name = re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", " ", name[:80])
    parted = unicodedata.normalize("NFD", name.lower().translate(_LETTERS))
    text = unicodedata.normalize("NFC", "".join(c for c in parted if not "\u0300" <= c <= "\u036f"))
    text = re.sub(r"[\s_]+", " ", text).strip()
    return re.sub(r"^(ch|channel|kanal|voie|canal)\.? ?\d+[ :]+", "", text)


def _words(text: str) -> tuple[str, ...]:
    """The words of a plain name: brackets with a channel or a source out, marks as blanks, a channel's number alone."""
    while (inner := re.sub(r"[(\[<（][^()\[\]<>（）]*[)\]>）]", " ", text)) != text and inner.strip(" .-:/"):
        text = inner
    text = re.sub(r"([^\W\d_]{3,})(\d)\b", r"\1 \2", text)
    return tuple(re.sub(r"[.:,;/|\-–()\[\]<>#]+", " ", text).split())


def _head(phrase: str) -> tuple[str, ...]:
    """The quantities of a head, also of one that another word is glued to in front."""
    if phrase in _HEADS:
        return _HEADS[phrase]
    if phrase in SYMBOLS:
        return SYMBOLS[phrase]
    for prefix in _GLUED:
        if phrase.startswith(prefix) and (found := _HEADS.get(phrase[len(prefix):].lstrip(" ")) or
                                          (_head(phrase[len(prefix):]) if len(phrase) - len(prefix) > 2 else ())):
            return found
    return ()


def _table() -> dict[str, tuple[str, ...]]:
    heads = {_plain(head.replace("\n", " ")): (quantity,) for quantity, text in HEADS.items()
             for head in text.split(",")}
    shared = {_plain(head): quantities for text, quantities in SHARED_HEADS.items() for head in text.split(",")}
    return heads | shared


_HEADS = _table()
_QUALIFIERS = {word for text in QUALIFIERS.split() for word in _words(_plain(text))}
_GLUED = sorted({_plain(word) for word in GLUED.split()}, key=len, reverse=True)
