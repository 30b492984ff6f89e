# SPDX-License-Identifier: Apache-2.0
"""Cameras and times for pictures and measurements of the scenes of config/scenes."""

# Scene → (eye, look_at) far and close, mm; z is up in demo and optix-*, y in vkray-*. The dissertation's scenes that are
# close views of another scene are links in config/scenes and are covered by that scene's close view.
FAR, CLOSE = ((0, -340, 170), (0, 0, 55)), ((0, -250, 110), (0, 0, 55))
FAR_Y, CLOSE_Y = ((0, 170, 340), (0, 55, 0)), ((0, 110, 250), (0, 55, 0))
ROOM_FAR, ROOM_CLOSE = ((45, -265, 150), (27, -60, 38)), ((35, -168, 90), (27, -60, 30))
VIEWS = {
    "optix-cs": (FAR, CLOSE),
    "optix-b": (FAR, ((0, -160, 80), (0, 0, 36))),
    "optix-hb": (FAR, ((0, -190, 85), (0, 0, 52))),
    "optix-gl": (FAR, ((0, -170, 75), (0, 0, 60))),
    "optix-gd": (FAR, ((0, -165, 80), (0, 0, 38))),
    "vkray-cs": (FAR_Y, CLOSE_Y),
    "vkray-b": (FAR_Y, ((0, 80, 155), (0, 33, 0))),
    "vkray-hb": (FAR_Y, ((0, 90, 215), (0, 56, 0))),
    "vkray-hbf": (FAR_Y, ((0, 90, 215), (0, 56, 0))),
    "vkray-md": (FAR_Y, ((0, 70, 110), (0, 34, -20))),
    "optix-skybox-bunny": (ROOM_FAR, ((122, -112, 75), (27, -60, 33))),
    "optix-skybox-dragon": (ROOM_FAR, ((128, -95, 80), (25, -60, 28))),
    "optix-skybox-buddha": (ROOM_FAR, ((95, -210, 85), (25, -60, 52))),
    "optix-skybox-teapot": (ROOM_FAR, ROOM_CLOSE),
    "optix-skybox-lucy": (((50, -360, 170), (10, -30, 75)), ((20, -225, 100), (2, 0, 80))),
    "demo": (((0, -260, 170), (0, 0, 20)), ((0, -150, 100), (0, 0, 20))),
}

# The scene `moving`: one camera, several times in seconds.
MOVING_VIEW, MOVING_TIMES = ((0, -250, 135), (6, 0, 40)), (0, 1, 2, 3, 4, 5)
