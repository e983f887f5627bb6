"""One press against the stand-in with plain pyserial and plain nidaqmx, nothing of this project.

sautereau stand-in ideal --json > bench.json &
sautereau plan --out plan.json
python examples/plain_clients.py bench.json plan.json
"""

import json
import sys
from pathlib import Path

import grpc
import nidaqmx
import serial
from nidaqmx.constants import READ_ALL_AVAILABLE, AcquisitionType
from nidaqmx.grpc_session_options import GrpcSessionOptions

bench, plan = (json.loads(Path(name).read_text(encoding="utf-8")) for name in sys.argv[1:3])
with (
    serial.serial_for_url(bench["serial_port"], timeout=10) as galil,
    grpc.insecure_channel(bench["daq_address"]) as channel,
    nidaqmx.Task(grpc_options=GrpcSessionOptions(channel, "")) as task,
):

    def send(command: str) -> str:
        galil.write(command.encode() + b"\r")
        return galil.read_until(b":").decode().rstrip(":\r\n ")

    def begin(*commands: str) -> None:
        for command in (*commands, "BG AB"):
            send(command)
        while float(send("MG _BGA+_BGB")) > 0:
            pass

    send("EO 0")  # the controller answers without repeating the command
    send("SH AB")
    for speed in (60_000, 2_000):  # to the edge of the home switches, then slowly back
        begin(f"SP {speed},{speed}", "DC 9000000,9000000", "FE AB")
    send("DP {},{}".format(*plan["home"]))
    for target in (plan["hover"], plan["start"]):
        begin("SP 150000,150000", "PA {},{}".format(*target))
    for (a, b), (va, vb), t in zip(plan["steps"], plan["velocities"], plan["samples"], strict=True):
        send(f"PVA={a},{va},{t}")
        send(f"PVB={b},{vb},{t}")
    send("PVA=0,0,0")
    send("PVB=0,0,0")
    task.ai_channels.add_ai_voltage_chan("Dev1/ai0:1")
    task.timing.cfg_samp_clk_timing(51200, "", AcquisitionType.FINITE, samps_per_chan=25600)
    task.triggers.start_trigger.cfg_dig_edge_start_trig("/Dev1/PFI0")
    task.start()
    galil.write(b"SB 1;BT AB\r")  # the trigger's edge, and the motion up to a sample later
    velocity, force = task.read(READ_ALL_AVAILABLE, timeout=10)
    galil.read_until(b"::")
    send("MO AB")
    print(len(velocity), "samples, up to", max(velocity), "V and", max(force), "V")
