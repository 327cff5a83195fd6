"""The edge of the road: whether the ego's oriented rectangle lies properly inside.

Without closed gaps the verdicts are at least as strict as those of the drivability checker
(``commonroad_dc.feasibility.solution_checker``), see :class:`RoadBoundary`.
"""

from __future__ import annotations

import math
from copy import copy
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.scene.road.gaps import PREPARED, SLIVER, Gaps, beyond
from repair.scene.road.joints import Bridge
from repair.scene.road.sections import endless, outlines

if TYPE_CHECKING:
    from repair.vehicle.parameters import Vehicle

__all__ = ["RoadBoundary", "grouping"]

# The rectangle may come this close to the edge [m] only where the exact test says so.
_TOUCH = 1e-6
# Consecutive poses are put into one box over about this distance [m], and so many at most.
_BOX = 4.0
_MOST = 32
# Up to so many poses are looked at one by one: boxes would cost more than they save.
_SINGLE = 40
# Who leaves the road mostly does so at one of the first poses that are in doubt: so many are asked first.
_FIRST = 8
# The corners of a box with sides (back, right, front, left).
_AROUND = np.array([[2, 3], [0, 3], [0, 1], [2, 1]])


class RoadBoundary:
    """The road as one region: the ego's rectangle must lie properly inside.

    The region is the union of the lane sections, a section being a lanelet with all its lateral
    neighbours; the drivability checker's triangulated boundary
    (``solution_checker._construct_boundary_checker``) fills what is outside the same sections. That
    triangulation needs the package ``triangle``, whose licence is not free; where it is installed,
    :meth:`official_off_road` asks it as well.

    Parameters
    ----------
    scenario : commonroad.scenario.scenario.Scenario
        Only read.
    vehicle : Vehicle
        The ego.
    gap : float
        Gaps and holes up to this width [m] between lanelets are road: they come from drawing the map.

    Attributes
    ----------
    region : shapely geometry
        The road.
    spare : float
        More than the rounding of any coordinate of the region [m].
    """

    def __init__(self, scenario: Any, vehicle: Vehicle, gap: float = 0.0) -> None:
        import shapely

        self._scenario = scenario
        self._corners = vehicle.corners
        self.region = shapely.union_all(outlines(scenario.lanelet_network))
        self._drawn = self.region
        if gap > 0.0:
            self.region = _closed(self.region, gap)
        shapely.prepare(self.region)
        self.spare = max(_TOUCH, 1e-14 * float(np.abs(np.nan_to_num(self.region.bounds)).max(initial=0.0)))
        self._triangles: Any = None

    def over_a_gap(
        self, x: Array, y: Array, orientation: Array
    ) -> tuple[int, str, tuple[float, float]] | None:
        """The first of poses (K,) that crosses what is road here and in no section of the map.

        Returns
        -------
        tuple or None
            Its index, where and how much of it in words, and the place [m].
        """
        gaps = self._gaps
        if gaps is None or not len(x):
            return None
        close = gaps.near(x, y, abs(complex(*self._corners[0])) + self.spare)
        if not len(close):
            return None
        import shapely

        pose, boxes = self._around(x[close], y[close], orientation[close])
        if len(boxes):
            close = close[np.unique(pose[:, gaps.met(shapely.polygons(boxes))])]
        if not len(close):
            return None
        bodies = shapely.polygons(self.outline(x[close], y[close], orientation[close]))
        near = gaps.met(bodies)
        for index, body in zip(close[near].tolist(), bodies[near], strict=True):
            part = shapely.intersection(body, gaps.region)
            if (area := float(shapely.area(part))) > SLIVER:
                at = shapely.centroid(part)
                words = (
                    f"the way crosses a gap of the map at ({at.x:.1f}, {at.y:.1f}), {area:.3f} m² under the "
                    "ego, or lanelets drawn askew: road here (checker.road_gap), and none for CommonRoad's "
                    "own boundary check"
                )
                return index, words, (float(at.x), float(at.y))
        return None

    @cached_property
    def _gaps(self) -> Gaps | None:
        """What is road here and none for the drivability checker, which has the sections alone; or None."""
        import shapely

        sections = shapely.union_all(outlines(self._scenario.lanelet_network, sections_alone=True))
        return beyond(self.region, sections)

    def widened(self, by: float) -> RoadBoundary:
        """The road as it would be if every section of it reached farther by ``by`` [m] on all sides."""
        import shapely

        wider, gaps = copy(self), self._gaps
        sections = self.region if gaps is None else shapely.difference(self.region, gaps.region)
        wider.region = shapely.buffer(self.region, by)
        shapely.prepare(wider.region)
        wider._gaps = None if gaps is None else beyond(wider.region, shapely.buffer(sections, by))
        return wider

    def bridged(self, near: Any = None) -> list[Bridge]:
        """The gaps and holes of the map that count as road.

        Parameters
        ----------
        near : shapely geometry, optional
            Only those that meet it.
        """
        import shapely

        return [one for part, one in self._bridges if near is None or shapely.intersects(part, near)]

    @cached_property
    def _bridges(self) -> list[tuple[Any, Bridge]]:
        """What counts as road and is drawn by nobody."""
        import shapely

        if self.region is self._drawn:
            return []
        found = []
        for part in shapely.get_parts(shapely.difference(self.region, self._drawn)):
            area, half = float(shapely.area(part)), 0.5 * float(shapely.length(part))
            if area <= SLIVER:
                continue
            inside = shapely.point_on_surface(part)
            width = 0.5 * (half - max(half**2 - 4.0 * area, 0.0) ** 0.5)  # of a rectangle, bent or not
            found.append((part, Bridge("hole", width, (float(inside.x), float(inside.y)))))
        return found

    def first_off_road(self, x: Array, y: Array, orientation: Array) -> int | None:
        """Index of the first pose at which the ego touches or leaves the edge of the road, or None.

        :meth:`surely_inside` settles most of many poses; asked exactly are the others.

        Parameters
        ----------
        x, y, orientation : (K,) array
            Centre [m] and orientation [rad] of the ego.
        """
        unsure = np.arange(len(x))
        if len(x) > 2 * _FIRST:
            first = self._left_at(x, y, orientation, unsure[:_FIRST])
            if first is not None:
                return first
            unsure = unsure[_FIRST:]
        if len(unsure) > _SINGLE:
            unsure = unsure[~self.surely_inside(x[unsure], y[unsure], orientation[unsure])]
        return self._left_at(x, y, orientation, unsure)

    def _left_at(self, x: Array, y: Array, orientation: Array, asked: npt.NDArray[np.intp]) -> int | None:
        """The first of some poses, by index, that is off the road; None where there is none."""
        inside = self.inside(self.outline(x[asked], y[asked], orientation[asked]))
        return None if inside.all() else int(asked[np.argmin(inside)])

    def departure(self, x: float, y: float, orientation: float) -> tuple[str, tuple[float, float]]:
        """Where a pose that leaves the road does so, and by how much: in words, and the place [m]."""
        import shapely

        pose = (np.array([value]) for value in (x, y, orientation))
        body = shapely.polygons(self.outline(*pose))[0]
        around = shapely.clip_by_rect(self.region, *shapely.buffer(body, 1.0).bounds)
        beyond = shapely.difference(body, around)
        area = float(shapely.area(beyond))
        if area <= 0.0:
            return f"the ego touches the edge of the road at ({x:.1f}, {y:.1f})", (x, y)
        corners = shapely.points(shapely.get_coordinates(beyond))
        far = float(np.max(shapely.distance(corners, around))) if not shapely.is_empty(around) else np.inf
        where = shapely.centroid(beyond)
        by = f"by {far:.2f} m, {area:.3f} m²" if np.isfinite(far) else "altogether"
        words = f"the ego leaves the road at ({where.x:.1f}, {where.y:.1f}) {by}"
        return words, (float(where.x), float(where.y))

    def inside(self, outlines: Array) -> npt.NDArray[np.bool_]:
        """Whether outlines (K, V, 2) lie properly inside of the road: exact, and safe among threads."""
        import shapely

        polygons = shapely.polygons(outlines)
        with PREPARED:
            return np.asarray(shapely.contains_properly(self.region, polygons))

    def surely_inside(self, x: Array, y: Array, orientation: Array) -> npt.NDArray[np.bool_]:
        """Poses (K,) that lie inside because a larger box does; False says nothing.

        Parameters
        ----------
        x, y, orientation : (K,) array
            Centre [m] and orientation [rad] of the ego.
        """
        known = np.zeros(len(x), dtype=np.bool_)
        pose, boxes = self._around(x, y, orientation)
        inside = self.inside(boxes)
        known[pose[:, inside] if not inside.all() else pose] = True
        return known

    def _around(self, x: Array, y: Array, orientation: Array) -> tuple[npt.NDArray[np.intp], Array]:
        """Boxes that hold several consecutive poses each; none where they are too far apart, or not finite.

        One box, turned like the pose in its middle, holds several: asking about boxes instead of poses
        saves most of the geometry library's time. Its half sizes grow by what a pose turned by an angle t
        reaches farther, at most size * |t|.

        Returns
        -------
        pose : (size, G) int array
            Which poses each of G boxes holds.
        boxes : (G, 4, 2) array
            Their corners [m].
        """
        count = len(x)
        travelled = abs(x[-1] - x[0]) + abs(y[-1] - y[0]) if count else np.inf
        size = min(int(_BOX * count / (travelled + _BOX)), _MOST) if travelled < np.inf else 0
        if size < 2 or not np.isfinite(np.array((x, y, orientation))).all():
            return np.empty((0, 0), dtype=np.intp), np.empty((0, 4, 2))
        pose = grouping(count, size)
        middle = pose[size // 2]
        centre = x + 1j * y
        heading, origin = orientation[middle], centre[middle]
        axis = np.exp(1j * heading)
        seen = ((centre[pose] - origin) * axis.conj()).view(np.float64)
        turn = np.maximum.reduce(np.abs(orientation[pose] - heading), axis=0)
        half = self._corners[0] + self.spare + turn[:, None] * self._corners[0, ::-1]
        sides = np.empty((len(middle), 4))
        sides[:, :2] = np.minimum.reduce(seen, axis=0).reshape(-1, 2) - half
        sides[:, 2:] = np.maximum.reduce(seen, axis=0).reshape(-1, 2) + half
        corners = sides.take(_AROUND, axis=1).view(np.complex128)[..., 0]
        corners = corners * axis[:, None] + origin[:, None]
        return pose, corners.view(np.float64).reshape(-1, 4, 2)

    def outline(self, x: Array, y: Array, orientation: Array) -> Array:
        """Corners of the ego's rectangle (K, 4, 2) at poses (K,), anticlockwise [m].

        Far off any road for a pose that is not finite: whoever asks where it lies is told "outside".
        """
        cos, sin = np.cos(orientation)[:, None], np.sin(orientation)[:, None]
        forward, left = self._corners[:, 0], self._corners[:, 1]
        corners = np.empty((len(x), 4, 2))
        corners[..., 0] = x[:, None] + cos * forward - sin * left
        corners[..., 1] = y[:, None] + sin * forward + cos * left
        if math.isfinite(np.add.reduce(corners, axis=None)):  # a sum is cheaper than a look at each
            return corners
        return np.nan_to_num(corners, nan=1e12, posinf=1e12, neginf=-1e12)

    def official_off_road(self, x: Array, y: Array, orientation: Array) -> int | None:
        """As :meth:`first_off_road`, by the drivability checker's triangulation, built at the first call.

        The two differ only next to ends of the map: the triangulation has no edge across the end of a
        section that has successors, and a triangle may reach into the road there. None also where the
        triangulation cannot be had (:attr:`official_available`).
        """
        if not self.official_available:
            return None
        import shapely

        hits = self._triangles.query(
            shapely.polygons(self.outline(x, y, orientation)), predicate="intersects"
        )
        return int(hits[0].min()) if hits.size else None

    @property
    def official_available(self) -> bool:
        """Whether the checker can triangulate this road: it fails on some, or lacks ``triangle``."""
        if self._triangles is None:
            import shapely
            from commonroad_dc.boundary import construction

            try:
                if endless(self._scenario.lanelet_network):
                    raise ValueError("neighbours lead back to where they began")
                parts = construction.construct(self._scenario, ["section_triangles", "triangulation"])
            except Exception:  # whatever goes wrong in there, there is no triangulation to ask
                self._triangles = False
            else:
                # As plain geometry: pycrcc reports objects that live until the interpreter's exit as leaks.
                corners = np.array([triangle.vertices() for triangle in parts["triangulation"].unpack()])
                self._triangles = shapely.STRtree(shapely.polygons(corners.reshape(-1, 3, 2)))
        return self._triangles is not False


def _closed(region: Any, gap: float) -> Any:
    """A region with all that no disc as wide as the gap gets into from outside (morphological closing).

    With mitred corners, which would leave inner corners as they are, GEOS 3.14 loses whole regions.
    """
    import shapely

    half = 0.5 * gap + 1e-6
    return shapely.union(region, shapely.buffer(shapely.buffer(region, half), -half))


@lru_cache(maxsize=256)
def grouping(count: int, size: int) -> npt.NDArray[np.intp]:
    """Indices (size, G) of consecutive poses in groups; the last pose fills up the last group."""
    groups = np.minimum(np.arange(-(-count // size) * size), count - 1).reshape(-1, size)
    by_place = np.ascontiguousarray(groups.T)
    by_place.setflags(write=False)
    return by_place
