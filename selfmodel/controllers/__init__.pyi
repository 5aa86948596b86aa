from .command_source import CommandSource as CommandSource
from .controller import Controller as Controller, Design as Design, draw_genomes as draw_genomes
from .cpg import Cpg as Cpg
from .network import Network as Network
from .playback import Playback as Playback
