"""The words that machines and people use for a column or a specimen's size, in the languages they use them in."""

import re
import unicodedata
from functools import cache

from matcal.readers.modulus_words import modulus_of

KINDS = ("uniaxial", "biaxial", "planar", "shear", "volumetric", "relaxation", "conductivity")  # kinds of tests

# first match wins; each is matched against the whole lower-case name, accents and channel prefixes taken off
_COLUMNS = (
    # English, German, French, Spanish and Portuguese, Italian, Dutch; Chinese; Japanese
    ("time", r"(elapsed |test |running |corrected |total |segment |cycle elapsed |total elapsed )?time|t"
             r"|(lauf|pruf|test|versuchs)?zeit|temps|duree|tiempo|tempo|(test)?tijd"
             r"|(试验|测试|运行|总)?时间|時間|試験時間"),
    ("displacement", r"displacement|crosshead|extension|(crosshead |axial )?position|disp|travel|stroke|deflection"
                     r"|(compressive|tensile|flexure) (extension|displacement)"
                     r"|(axial|crosshead|cross head|digital) (displacement|position|travel|extension)"
                     r"|weg|(standard|traversen|kolben|maschinen|pruf)weg|verschiebung"
                     r"|deplacement( (de la )?traverse)?|traverse|allongement|course"
                     r"|desplazamiento|deslocamento|extensao|recorrido|spostamento|corsa|verplaatsing"
                     r"|(压缩|拉伸|轴向|横梁)?位移|(压缩|拉伸)?行程|変位|ストローク"),
    ("force", r"load|force|f|(axial|compressive|tensile|standard) (force|load)"
              r"|kraft|(standard|pruf|axial|druck|zug)kraft|last|effort|charge|fuerza|carga|forca|forza|carico|kracht"
              r"|(压缩|拉伸|轴向|试验)?(力|载荷|负荷|荷重|负载)|荷重|試験力"),
    ("lateral_stretch", r"(lateral|transverse) stretch( ratio)?|(lambda|λ) ?(2|lat|t|lateral|transverse)"),
    ("lateral", r"(lateral|transverse) (nominal |engineering )?strain|(eps|epsilon|ε) ?(2|lat|t|lateral|transverse)"
                r"|querdehnung|deformation transversale|横向应变"),
    ("stretch", r"stretch|lambda|λ|stretch ratio"),
    ("strain", r"(nominal |engineering |compressive |tensile |shear |axial |volumetric |volume )?strain"
               r"|eps|epsilon|ε|gamma|γ|e"
               r"|(nenn|technische )?dehnung|stauchung|(nenn)?verzerrung|scherung|deformacion|deformazione|rek"
               r"|(压缩|拉伸|剪切|工程|名义)?应变|ひずみ"),
    ("stress", r"(nominal |engineering |compressive |tensile |shear |piola |axial )?stress|sigma|σ|tau|τ|p|pk1"
               r"|(nenn|druck|zug|schub|stauch|technische )?spannung|contrainte( nominale)?|esfuerzo|sforzo|spanning"
               r"|(压缩|拉伸|剪切|工程|名义)?应力|応力"),
    ("deviation", r"(stress )?(std|std ?dev|standard deviation|sd|deviation)|(std|sd|standard deviation) (of )?stress"
                  r"|(stress|sigma|σ|p) (std|sd|err|error|uncertainty)|standardabweichung|ecart type|标准差"),
    ("current", r"we\(1\)\.current|current|i|strom"),
    ("potential", r"we\(1\)\.potential|potential|voltage|u|v"),
    ("resistance", r"resistance|r|widerstand|电阻"),
    ("conductivity", r"conductivity|c|leitfahigkeit|电导率"),
    ("volume_ratio", r"volume ratio|volumetric ratio|j|v/v0|jacobian"),
    ("pressure", r"(hydrostatic )?pressure|压力"),
    ("cycle", r"(total )?cycles?( count| number| no\.?| index)?|(zyklus|zyklen)(zahl|nummer)?|循环(次数)?|周期"),
    ("block", r"block|block (number|no\.?)"),
)

# names of one quantity in order of preference, where a file has several
PREFERRED = {"time": (r"time|t|(lauf|pruf|versuchs)zeit|zeit|temps|时间|時間", r"(running|test|elapsed|total) time")}

_SIZES = (
    ("diameter", r"diameter|diametro|diametre|durchmesser|(probe[n]?)durchmesser|直径|直徑"),
    ("width", r"width|breite|(probe[n]?)breite|largeur|ancho|larghezza|宽度|宽|幅"),
    ("depth", r"depth|tiefe|profondeur|profundidad|深度"),
    ("thickness", r"thickness|dicke|(probe[n]?)dicke|epaisseur|espesor|spessore|厚度|厚"),
    ("height", r"height|(anvil|specimen|sample) height|hohe|(probe[n]?)hohe|hauteur|altura|altezza|高度|高"),
    ("length", r"length|gauge length|lange|(probe[n]?|mess)lange|longueur|longitud|lunghezza|长度|标距|长"),
    ("area", r"area|(cross section|cross sectional|initial) area|(querschnitts)?flache|querschnitt|surface|section"
             r"|面积|横截面积"),
)


# words that make a strain the logarithmic and a stress that over the area under load
_TRUE = re.compile(r"\b(true|log(arithmic)?|ln|hencky|cauchy|wahre?|vraie?|verdader[ao]|reale?)\b|真")


def true_quantity(name: str) -> str | None:
    """The quantity of a column name that calls it true (a logarithmic strain, a Cauchy stress), else None."""
    text, found = _TRUE.subn("", _plain(name))
    return quantity_of(text) if found else None


@cache
def quantity_of(name: str) -> str | None:
    """The quantity that a column name (without its unit) stands for, or None."""
    text = _plain(name)
    known = next((quantity for quantity, pattern in _COLUMNS if re.fullmatch(pattern, text)), None)
    return known or modulus_of(text)


def size_of(name: str) -> str | None:
    """The size (a key of `recording.SIZES`) that the name of a property stands for, or None."""
    text = _plain(re.split(r"[:：]", name.rstrip(" :："))[-1])
    text = re.sub(r" (in|en) \w{1,4}$| ?[(\[][^()\[\]]*[)\]]$", "", text)
    text = re.sub(r"^(?:(specimen|sample|initial|original) |试样|样品|试件)(?=\w)", "", text)
    return next((size for size, pattern in _SIZES if re.fullmatch(pattern, text)), None)


def preference(quantity: str, name: str) -> int:
    """Rank of a name among those of its quantity, 0 the first choice."""
    ranks = PREFERRED.get(quantity, ())
    return next((k for k, pattern in enumerate(ranks) if re.fullmatch(pattern, _plain(name))), len(ranks))


def _plain(name: str) -> str:
    """Lower case without accents, underscores, and the channel that a controller puts before a name."""
    parted = unicodedata.normalize("NFD", name[:80])
    text = unicodedata.normalize("NFC", "".join(c for c in parted if not "\u0300" <= c <= "\u036f"))
    text = re.sub(r"[\s_]+", " ", text.lower()).strip()
    return re.sub(r"^(ch|channel|kanal|voie|canal)\.? ?\d+[ :]+", "", text)
