"""What the OpenAPI document says of the whole; /docs shows it, and tries it out, by Swagger UI without a network."""

DESCRIPTION = """2D lidar scans to walls, corners and their covariances. Metres, radians, seconds.
Errors are problem details (RFC 9457).

`WebSocket /api/v1/stream` (`?points=true` adds the measured points) sends JSON objects with a member `type`:
`state` at first and after every change, with settings, source, selection, localization, recorder and ready;
`frame` with the members of `GET /api/v1/frame`; `landmarks` with what has changed in the map of a session; `walls`,
about once a second, with all walls of the map of whole scans, as in `GET /api/v1/walls`, and their `corners`. A slow
client gets fewer frames, never old ones. A client may send `{"type": "odometry", "stamp": ..., "x": ..., "y": ...,
"heading": ...}`, as `POST /api/v1/odometry` takes it; what is wrong with a message comes back as `error`.
"""
