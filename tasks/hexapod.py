"""The paper's hexapod: six legs, each with a hip of two degrees of freedom, and a knee."""

from selfmodel.tasks.paper import paper_robot

HEXAPOD = paper_robot("hexapod")
