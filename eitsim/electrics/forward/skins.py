"""Which way the electrics of a skin are solved: the one place where discs and outlines are distinguished."""

from eitsim.electrics.forward.disc_electrics import DiscSkin
from eitsim.electrics.forward.outline_electrics import OutlinedSkin
from eitsim.scene.scene import Body, Electrodes


def skin_of(body: Body, electrodes: Electrodes, conductance_S: float) -> DiscSkin | OutlinedSkin:
    """The solver of a skin whose electrodes all have contact, on a sheet of conductance S, S: discs are solved faster
    by formulas than as polygons."""
    return (OutlinedSkin if body.has_outline else DiscSkin)(body, electrodes, conductance_S)
