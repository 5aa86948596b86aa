from .anatomy import Anatomy as Anatomy, Joint as Joint, Sensor as Sensor
from .designs import DESIGNS as DESIGNS, cpg_for as cpg_for, network_for as network_for
from .mjcf.load import load_mjcf as load_mjcf
from .mjcf.settings import MjcfSettings as MjcfSettings
from .model_variant import ModelVariant as ModelVariant
from .robot import Robot as Robot
