"""A scene as data: the body, its skin and electrodes, the touches, and how well they must be known."""

import math
from dataclasses import dataclass, field

from eitsim.scene.channels import Channels
from eitsim.scene.drive import Drive
from eitsim.scene.edges.disc import Disc
from eitsim.scene.edges.edge import Edge
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import Electrodes

FRICTIONS = ("none", "stick", "coulomb")
STRAINS = ("normal", "principal", "areal")
CONTROLS = ("force", "depth")
MODULI = ("card", "instantaneous", "longterm")


@dataclass(frozen=True)
class Body:
    """Foam of one thickness, bottom fixed."""

    edge: Edge = field(default_factory=Disc)  # where it ends, and its coating with it
    thickness_m: float = 0.01  # of the foam, m

    @property
    def has_outline(self) -> bool:
        """Whether it is no disc."""
        return not self.edge.is_round

    @property
    def size_m(self) -> float:
        """Square root of its area over pi, m, by which lengths on the skin are measured."""
        return self.edge.size_m

    @property
    def radius_m(self) -> float:
        """Radius of a disc, m; ValueError for another edge."""
        if not isinstance(self.edge, Disc):
            raise ValueError(f"the body has the outline '{self.outline.kind}', and this is for discs.")
        return self.edge.radius_m

    @property
    def outline(self) -> Outline:
        """The outline of a skin that is no disc; ValueError for a disc."""
        if not isinstance(self.edge, Outline):
            raise ValueError("the body is a disc, and has no outline.")
        return self.edge


@dataclass(frozen=True)
class Punch:
    """Rigid axisymmetric punch pressed along -z."""

    # axis in the plane of the disc, m
    x_m: float = 0.0
    y_m: float = 0.0
    diameter_m: float = 0.014  # diameter, fillet included, m
    force_N: float | None = None  # applied force, N; 1 N unless it or the depth is given, None where the depth is given
    depth_m: float | None = None  # prescribed depth, m; None where the force is given
    profile: str = "flat"  # word of its profile
    # radius that rounds the edge, and a cone's tip; of an ellipse, its radius of curvature at the edge; m
    fillet_m: float = 0.0005
    # angle between a cone's axis and its face, rad; without effect on the other profiles
    half_angle_rad: float = math.radians(60)
    # angle, rad, between its axis, along which it is pressed, and the skin's normal; and the direction from the x axis
    # to which the axis leans, on whose side the edge stands lowest
    tilt_rad: float = 0.0
    tilt_direction_rad: float = 0.0
    friction: str = "none"  # one of FRICTIONS
    friction_coefficient: float = 0.0  # shear over pressure that it slips at; 0 unless by Coulomb's law
    conductor: bool = False  # whether the punch conducts and floats
    contact_impedance_Ohm_m2: float = 1e-4  # contact impedance of a conducting punch, Ohm m^2

    def __post_init__(self) -> None:
        if self.force_N is None and self.depth_m is None:
            object.__setattr__(self, "force_N", 1.0)


@dataclass(frozen=True)
class Skin:
    """Conductive coating of the top surface."""

    thickness_m: float = 20e-6  # of the coating, m
    strain: str = "principal"  # the strain that drives its conductivity, one of STRAINS


@dataclass(frozen=True)
class Hold:
    """How long the touch lasts."""

    time_s: tuple[float, ...] = ()  # times after loading at which it is read, s; empty: none
    control: str = "force"  # one of CONTROLS
    loading_s: float = 0.0  # time that loading takes at a constant rate of force or depth, s; 0: loaded at once
    # one of MODULI: as the card labels them, or scaled by its Prony series; a hold begins with instantaneous ones
    moduli: str = "card"

    @property
    def keeps_deformation(self) -> bool:
        """Whether the foam stays as it was loaded: at a depth kept from loading at once only stresses relax."""
        return self.control == "depth" and self.loading_s == 0


@dataclass(frozen=True)
class Accuracy:
    """The relative error that a scene's numbers may have."""

    signal: float = 0.01  # requested relative error of the touch signal dV, mechanics and electrics together


@dataclass(frozen=True)
class Scene:
    """Everything that one simulation needs but the card."""

    body: Body = field(default_factory=Body)  # the foam
    punches: tuple[Punch, ...] = field(default_factory=lambda: (Punch(),))  # one a touch
    skin: Skin = field(default_factory=Skin)  # the conductive coating
    electrodes: Electrodes = field(default_factory=Electrodes)  # how many, where, and their contacts
    drive: Drive = field(default_factory=Drive)  # which currents flow and what is read
    channels: Channels = field(default_factory=Channels)  # gains, true currents and leaks of the instrument
    hold: Hold = field(default_factory=Hold)  # times at which a touch that is held is read
    accuracy: Accuracy = field(default_factory=Accuracy)  # the requested error
    card: str | None = None  # path of the card that the scene file names; None where it names none

    def __post_init__(self) -> None:
        object.__setattr__(self, "punches", tuple(self.punches))
        object.__setattr__(self, "electrodes", self.body.edge.placed(self.electrodes))
