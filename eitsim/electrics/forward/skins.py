"""Which way the electrics of a skin are solved: the one place where discs and outlines are distinguished."""

from __future__ import annotations

from typing import TYPE_CHECKING

from eitsim.scene.scene import Body, Electrodes

if TYPE_CHECKING:
    from eitsim.electrics.forward.disc_electrics import DiscSkin
    from eitsim.electrics.forward.outline_electrics import OutlinedSkin


def skin_of(body: Body, electrodes: Electrodes, conductance_S: float) -> DiscSkin | OutlinedSkin:
    """The solver of a skin whose electrodes all have contact, on a sheet of conductance S, S: discs are solved faster
    by formulas than as polygons."""
    if body.has_outline:  # solvers are imported when they are needed: reading frames needs none
        from eitsim.electrics.forward.outline_electrics import OutlinedSkin as Skin
    else:
        from eitsim.electrics.forward.disc_electrics import DiscSkin as Skin
    return Skin(body, electrodes, conductance_S)
