"""QEMU's monitor, used from inside its own machine to unplug and plug in devices."""

import json
import os
import select
from pathlib import Path
from typing import Any

from lab.guest.commands import ScenarioError, seconds, wait
from lab.guest.machine_room import MachineRoom, virtio_port

CARD = {"driver": "kvaser_pci", "canbus": "bus0", "id": "card0", "addr": "0x10"}
ADAPTER = {
    "driver": "usb-serial",
    "chardev": "line",
    "always-plugged": True,
    "id": "adapter",
}
_PATIENCE = 20.0  # s of guest time
_is_greeted: list[bool] = []  # the monitor accepts its greeting once per boot


class Monitor:
    """Sends commands to the monitor."""

    def __init__(self, room: MachineRoom) -> None:
        self._room = room
        self._port = os.open(virtio_port("lab.monitor"), os.O_RDWR | os.O_NONBLOCK)
        self._received = b""
        if not _is_greeted:
            self._ask("qmp_capabilities", {})
            _is_greeted.append(True)

    def unplug(self, device: dict[str, Any], node: Path) -> None:
        """Unplug a device and wait until `node` has disappeared."""
        self._ask("device_del", {"id": device["id"]})
        self._await(node, is_there=False)

    def plug_in(self, device: dict[str, Any], node: Path) -> None:
        """Plug a device in again and wait until `node` exists."""
        end = seconds() + _PATIENCE
        # QEMU releases the old device a moment later than the kernel.
        while error := self._ask("device_add", device, is_checked=False):
            if seconds() > end:
                raise ScenarioError(f"device_add: {error}")
            wait(0.2)
        self._await(node, is_there=True)

    def close(self) -> None:
        """Close the connection."""
        os.close(self._port)

    def _await(self, node: Path, *, is_there: bool) -> None:
        end = seconds() + _PATIENCE
        while node.exists() is not is_there:
            if seconds() > end:
                raise ScenarioError(f"{node} is {'not ' if is_there else ''}there")
            wait(0.05)

    def _ask(
        self, name: str, arguments: dict[str, Any], *, is_checked: bool = True
    ) -> str:
        """Send a command; return the error message, "" on success."""
        text = json.dumps({"execute": name, "arguments": arguments})
        self._room.log.append(f"[monitor: {text}]\n")
        os.write(self._port, text.encode() + b"\n")
        end = seconds() + _PATIENCE
        while seconds() < end:
            for line in self._lines():
                answer: dict[str, Any] = json.loads(line)
                if "return" in answer:
                    return ""
                if error := answer.get("error"):
                    if is_checked:
                        raise ScenarioError(f"{name}: {error['desc']}")
                    return str(error["desc"])
        raise ScenarioError(f"{name}: the machine's monitor does not answer")

    def _lines(self) -> list[bytes]:
        if not select.select([self._port], [], [], 0.1)[0]:
            return []
        try:
            self._received += os.read(self._port, 65536)
        except BlockingIOError:
            return []
        *lines, self._received = self._received.split(b"\n")
        return [line for line in lines if line.strip()]
