"""Types of what ``import sloshlab`` offers; the names are imported when they are first asked for."""

from pipelines.interface.beam import BeamAnalysis as BeamAnalysis
from pipelines.interface.beam import analyse_beam as analyse_beam
from pipelines.interface.diagnosis import CaseVerdict as CaseVerdict
from pipelines.interface.diagnosis import diagnose as diagnose
from pipelines.interface.recordings import open_campaign as open_campaign
from pipelines.interface.recordings import open_recording as open_recording
from pipelines.interface.simulation import TwinSimulation as TwinSimulation
from pipelines.interface.simulation import simulate as simulate
from pipelines.interface.sweep import SweepAnalysis as SweepAnalysis
from pipelines.interface.sweep import analyse_sweep as analyse_sweep
from pipelines.interface.training import LiquidModel as LiquidModel
from pipelines.interface.training import train as train
from pipelines.interface.virtual import virtual_run as virtual_run
from sloshlab._version import __version__ as __version__
from sloshlab.errors import InputError as InputError
from sloshlab.errors import SloshlabError as SloshlabError
from sloshlab.recording import write_recording as write_recording
from sloshlab.rig import Rig as Rig
