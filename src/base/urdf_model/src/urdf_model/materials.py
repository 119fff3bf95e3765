# SPDX-License-Identifier: BSD-3-Clause
"""Colours for the material names that Gazebo's descriptions use, red, green, blue, alpha from 0 to 1.

Names that stand for a texture or an effect there get a plain colour of the same kind.
"""

_PLAIN = {
    "Black": (0.05, 0.05, 0.05),
    "Blue": (0.1, 0.1, 0.9),
    "BlueGlow": (0.1, 0.1, 1.0),
    "Bricks": (0.58, 0.36, 0.28),
    "CeilingTiled": (0.86, 0.86, 0.84),
    "DarkGray": (0.25, 0.25, 0.25),
    "DarkGrey": (0.25, 0.25, 0.25),
    "FlatBlack": (0.1, 0.1, 0.1),
    "Footway": (0.62, 0.61, 0.58),
    "Gold": (0.85, 0.65, 0.15),
    "Gray": (0.6, 0.6, 0.6),
    "Green": (0.1, 0.75, 0.1),
    "GreenGlow": (0.1, 1.0, 0.1),
    "Grey": (0.6, 0.6, 0.6),
    "Indigo": (0.33, 0.0, 0.5),
    "LightOff": (1.0, 0.0, 0.0),
    "LightOn": (0.0, 1.0, 0.0),
    "LightWood": (0.80, 0.66, 0.46),
    "Motorway": (0.25, 0.25, 0.25),
    "Orange": (1.0, 0.45, 0.05),
    "PaintedWall": (0.85, 0.83, 0.78),
    "Pedestrian": (0.62, 0.61, 0.58),
    "Primary": (0.3, 0.3, 0.3),
    "Purple": (0.65, 0.1, 0.75),
    "PurpleGlow": (1.0, 0.0, 1.0),
    "Red": (0.9, 0.1, 0.1),
    "RedBright": (1.0, 0.05, 0.05),
    "RedGlow": (1.0, 0.1, 0.1),
    "Residential": (0.35, 0.35, 0.35),
    "Road": (0.3, 0.3, 0.3),
    "SkyBlue": (0.3, 0.65, 0.95),
    "Turquoise": (0.1, 0.85, 0.85),
    "TurquoiseGlow": (0.0, 1.0, 1.0),
    "White": (1.0, 1.0, 1.0),
    "WhiteGlow": (1.0, 1.0, 1.0),
    "Wood": (0.62, 0.44, 0.26),
    "WoodFloor": (0.66, 0.50, 0.32),
    "WoodPallet": (0.70, 0.56, 0.36),
    "Yellow": (0.95, 0.85, 0.1),
    "YellowGlow": (1.0, 0.95, 0.1),
    "ZincYellow": (0.97, 0.95, 0.2),
}

#: Names of materials that give off light themselves, in these colours: red, green, blue from 0 to 1.
GLOWS = {"Gazebo/" + name: rgb for name, rgb in {
    "BlueGlow": (0.0, 0.0, 1.0),
    "GreenGlow": (0.0, 1.0, 0.0),
    "LightOff": (1.0, 0.0, 0.0),
    "LightOn": (0.0, 1.0, 0.0),
    "PurpleGlow": (1.0, 0.0, 1.0),
    "RedGlow": (1.0, 0.0, 0.0),
    "TurquoiseGlow": (0.0, 1.0, 1.0),
    "WhiteGlow": (1.0, 1.0, 1.0),
    "YellowGlow": (1.0, 1.0, 0.0),
}.items()}
#: "Gazebo/Red" and its like -> rgba.
MATERIALS = {"Gazebo/" + name: (*rgb, 1.0) for name, rgb in _PLAIN.items()}
