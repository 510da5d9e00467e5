from acqd.api import datasets as datasets
from acqd.api.dataset import Dataset as Dataset
from acqd.api.logs import RobotLog as RobotLog
from acqd.api.logs import read_log as read_log
from acqd.api.loop import LoopResult as LoopResult
from acqd.api.loop import close_loop as close_loop
from acqd.api.meter import Meter as Meter
from acqd.api.meter import WindowBatch as WindowBatch
from acqd.api.models import Model as Model
from acqd.api.models import export_fmu as export_fmu
from acqd.api.models import export_onnx as export_onnx
from acqd.api.models import open_model as open_model
from acqd.api.models import predict as predict
from acqd.api.models import train as train
from acqd.api.robot import Robot as Robot
from acqd.api.rows import Rows as Rows
from acqd.api.rows import read_rows as read_rows
from acqd.errors import InputError as InputError
from acqd.errors import OperationError as OperationError
from acqd.errors import UserError as UserError
from acqd.models.predict import Prediction as Prediction

__all__: list[str]
__version__: str
