from .channel import Channel, ChannelClosedError
from .child import Child, ChildContext, ProcessLostError, name_process
from .frame_tape import FrameTape, last_frames
from .layout import (
    TIMING_DTYPE,
    WRENCH_SLOTS,
    ProcessRole,
    SharedLayout,
    unpack_wrenches,
)
from .loop_client import LoopClient
from .loop_server import LoopHooks, LoopServer, no_bell
from .rings import give_back_heap, require_ordered_stores
from .rpc import RpcServer, bind, make_proxy
from .shared_sensor import SharedSensor, publish

__all__ = [
    "TIMING_DTYPE",
    "WRENCH_SLOTS",
    "Channel",
    "ChannelClosedError",
    "Child",
    "ChildContext",
    "FrameTape",
    "LoopClient",
    "LoopHooks",
    "LoopServer",
    "ProcessLostError",
    "ProcessRole",
    "RpcServer",
    "SharedLayout",
    "SharedSensor",
    "bind",
    "give_back_heap",
    "last_frames",
    "make_proxy",
    "name_process",
    "no_bell",
    "publish",
    "require_ordered_stores",
    "unpack_wrenches",
]
