"""The system of Więckowski (1992) as it is printed: its element, its plate, the friction law at four points an edge.

To be read beside the paper. For bodies of your own take `qvi_contact.solve`, whose triangles are far closer for the
same number of unknowns.
"""

from qvi_contact.paper.quarter_plate import QuarterPlate, plate

__all__ = ["QuarterPlate", "plate"]
