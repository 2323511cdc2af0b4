"""Every route that there is, from the cheapest on; CPU times as in benchmarks/results, sweeps_ways.csv and
edge_touches.csv. A new route is one file and its line here."""

from eitsim.simulation.routes.all_edges import ALL_EDGES
from eitsim.simulation.routes.axisymmetric import AXISYMMETRIC
from eitsim.simulation.routes.general import General
from eitsim.simulation.routes.nearest_alone import NearestAlone
from eitsim.simulation.routes.on_surface import ON_SURFACE
from eitsim.simulation.routes.pair import Pair
from eitsim.simulation.routes.route import Route
from eitsim.simulation.routes.whole_disc import WholeDisc

ROUTES: tuple[Route, ...] = (
    AXISYMMETRIC,
    NearestAlone(),
    ALL_EDGES,
    WholeDisc(),
    Pair(),
    General(),
    ON_SURFACE,
)
