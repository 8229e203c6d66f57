"""The nodes of the viser scene: made once, and what they hold replaced in place."""

from typing import Any, Literal

import numpy as np
from viser import ViserServer

from lidarcore.geometry import act

from .colours import Rgbs, untoned
from .shapes import DISC_FACES, DISC_VERTICES, Array, about_z, lift

FIELD_OF_VIEW = np.radians(6.0)  # so narrow that the picture is nearly orthographic
FAR = 2e4  # m
HEIGHTS = {  # from the floor up
    "occupancy": -1, "walls": 1, "gaps": 1, "true": 1, "reckoned": 1, "cluster fill": 1, "trail": 2, "clusters": 3,
    "points": 4, "segments": 5, "rejected": 6, "associations": 7,
}  # fmt: skip

BODY = frozenset(("gaps", "segments", "cluster fill", "clusters", "points", "rejected"))


class Canvas:
    """A map in layers: discs, strokes and points in metres, seen from above; the page draws marks and ellipses over it.

    What is under /body is given in the sensor frame, and `place` says where that is; the rest in the world frame.
    All is sent in the world frame: a browser may take up a node's place and what is in it at different moments.
    """

    def __init__(self, server: ViserServer) -> None:
        self._server, self._scene = server, server.scene
        server.gui.main_panel.minimize()
        self._scene.world_axes.visible = False
        self._scene.configure_default_lights(enabled=False)
        self._scene.configure_environment_map(None)
        self._scene.add_light_ambient("/light", intensity=np.pi)  # flat: every surface shows its own colour
        self._pose = np.zeros(3)
        self._nodes: dict[str, Any] = {
            "occupancy": self._scene.add_image(
                "/occupancy", np.zeros((1, 1, 4), np.uint8), 1.0, 1.0, cast_shadow=False, receive_shadow=False
            ),
            "walls": self._add_strokes("/walls", 2),
            "true": self._add_strokes("/trails/true", 1.5),
            "reckoned": self._add_strokes("/trails/reckoned", 1),
            "trail": self._add_strokes("/trails/estimated", 1.5),
            "associations": self._add_strokes("/associations", 1.5),
            "gaps": self._add_strokes("/body/gaps", 1),
            "segments": self._add_strokes("/body/segments", 2),
            "cluster fill": self._add_discs("/body/clusters/fill", 0.15),
            "clusters": self._add_strokes("/body/clusters/outline", 2),
            "points": self._add_points("/body/points", "circle"),
            "rejected": self._add_points("/body/rejected/points", "square"),
        }

    def fit(self, reach: float) -> None:
        """Set heights and the first look for a room that reaches this far, m."""
        for name, height in HEIGHTS.items():
            self._nodes[name].position = (0.0, 0.0, height * reach / 500)
        height = reach / np.tan(FIELD_OF_VIEW / 2)
        camera = self._server.initial_camera
        camera.position, camera.look_at = (0.0, -1e-5 * height, height), (0.0, 0.0, 0.0)
        camera.fov, camera.near, camera.far = FIELD_OF_VIEW, 1.0, FAR

    def ground(self, dark: bool) -> None:
        """Set the ground: dark or light."""
        self._server.gui.configure_theme(dark_mode=dark, show_logo=False, show_share_button=False)

    def place(self, pose: Array) -> None:
        """Draw what is in the sensor frame at T_world_sensor (3,) from now on."""
        self._pose = pose

    def visible(self, name: str, visible: bool) -> None:
        """Show or hide a layer as it is."""
        self._nodes[name].visible = bool(visible)

    def strokes(self, name: str, visible: bool, strokes: Array, colours: Rgbs) -> None:
        """Show (S, 2, 2) strokes in one colour (3,) or in (S, 3)."""
        self.visible(name, visible and len(strokes) > 0)
        if visible and len(strokes):
            each = np.broadcast_to(untoned(colours).reshape(-1, 1, 3), (len(strokes), 2, 3))
            self._set(name, points=lift(self._in_world(name, strokes)), colors=each)

    def points(self, name: str, visible: bool, xy: Array, colours: Rgbs) -> None:
        """Show points (N, 2) in one colour (3,) or in (N, 3)."""
        self.visible(name, visible and len(xy) > 0)
        if visible and len(xy):
            self._set(name, points=lift(self._in_world(name, xy)), colors=colours)

    def discs(self, name: str, visible: bool, xy: Array, half: Array, angle: Array, colours: Rgbs) -> None:
        """Show ellipses (C, 2) with half axes (C, 2) turned by angles (C,), in colours (C, 3)."""
        self.visible(name, visible and len(xy) > 0)
        if visible and len(xy):
            # A browser that joins is told first what was set longest ago, and equal values are not set again: it
            # would hear of many colours while it knows of one disc, and complain. So colours are always set anew.
            self._set(name, batched_colors=np.zeros(3, np.uint8))
            self._set(
                name,
                batched_positions=lift(self._in_world(name, xy)),
                batched_wxyzs=about_z(angle + (self._pose[2] if name in BODY else 0.0)),
                batched_scales=lift(half, 1.0),
                batched_colors=untoned(colours),
            )

    def picture(self, name: str, pixels: Rgbs, size: tuple[float, float], T_world_image: Array) -> None:
        """Show pixels (H, W, 4), the first row at the smallest y, on a plane of a width and height (m).

        The pose (3,) is that of the middle.
        """
        self._set(name, image=pixels, render_width=size[0], render_height=size[1])
        height = self._nodes[name].position[2]
        self._set(name, position=(*T_world_image[:2].tolist(), height), wxyz=about_z(T_world_image[2:])[0])
        self.visible(name, True)

    def _in_world(self, name: str, xy: Array) -> Array:
        return act(self._pose, xy) if name in BODY else xy

    def _set(self, name: str, **properties: Any) -> None:
        for key, value in properties.items():
            setattr(self._nodes[name], key, value)

    def _add_strokes(self, name: str, thickness: float) -> Any:
        # A colour for each vertex from the start: viser cannot change from one for all to one for each.
        colours = np.zeros((1, 2, 3), np.uint8)
        strokes = np.zeros((1, 2, 3))
        return self._scene.add_line_segments(
            name, strokes, colours, thickness=thickness, thickness_units="screen"
        )

    def _add_points(self, name: str, shape: Literal["circle", "square"]) -> Any:
        return self._scene.add_point_cloud(
            name, np.zeros((1, 3)), (0, 0, 0), point_shape=shape, point_shading="flat", precision="float32"
        )

    def _add_discs(self, name: str, opacity: float) -> Any:
        return self._scene.add_batched_meshes_simple(
            name, DISC_VERTICES, DISC_FACES, about_z(np.zeros(1)), np.zeros((1, 3)), opacity=opacity,
            batched_scales=np.ones((1, 3)), batched_colors=np.zeros((1, 3), np.uint8), side="double", lod="off",
            material="toon3", cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
