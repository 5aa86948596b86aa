"""The paper's quadruped: four legs, each with a shoulder and a knee; see ``quadruped.xml``."""

from selfmodel.tasks.paper import paper_robot

QUADRUPED = paper_robot("quadruped")
