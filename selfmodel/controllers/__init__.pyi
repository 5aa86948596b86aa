from .compensation import Compensated as Compensated
from .controller import (
    CommandSource as CommandSource,
    Controller as Controller,
    Design as Design,
    draw_genomes as draw_genomes,
)
from .cpg import Cpg as Cpg
from .network import Network as Network
from .playback import Playback as Playback
from .policy import Policy as Policy
