"""Tyndall's service against trame's remote rendering: one viewer that turns a volume, over a WebSocket on this machine.

    python3 -m venv venv && venv/bin/pip install trame trame-rca vtk aiohttp msgpack pillow PyTurboJPEG
    make build && venv/bin/python tests/peers/trame_remote.py --out docs/benchmarks

Not part of the test suite. PyTurboJPEG needs libturbojpeg (Debian: libturbojpeg0); without it trame encodes with Pillow,
which is slower. Both servers are asked alike: a camera every 1/60 s that turns about the volume, for
SECONDS after a warm-up. Counted are pictures that arrive, their bytes, and for each camera the time until a picture
arrives that shows it or a newer one. The volume (buckyball, 128 voxels along an edge), transfer function, light and
viewport (512 x 512) are the same; the step is one voxel.

trame draws with VTK's CPU ray caster, which beats its GPU mapper where there is no GPU, and sends JPEG by
trame-rca's scheduler and encoder, as its own widgets do; the camera is set by the interaction message, so that nothing
is lost to mouse handling. It draws every picture whole. Tyndall shrinks pictures while the camera moves until they come
in time: the column `pixels` says how many of the viewport's pixels a picture has on average. So a second trame case
draws at the size that Tyndall chose.
"""

import argparse
import asyncio
import csv
import json
import math
import os
import pathlib
import platform
import statistics
import struct
import subprocess
import sys
import tempfile
import time

import aiohttp
import msgpack

import vtk_ray_caster as peer

ROOT = pathlib.Path(__file__).resolve().parents[2]
SIZE = 512
SECONDS = 15
WARM_UP = 4
INPUTS_PER_SECOND = 60
TURN = 0.02
FRAME_HEADER = struct.Struct("<IHBBIIIIfIfHHHHIIIII")


def scene_of(binary, folder):
    """The case both draw: name, voxels, scene."""
    return next(iter(peer.cases(binary, folder)))


def serve_trame(case, shaded, edge, port):
    """Runs a trame server until it is killed."""
    from trame.app import get_server
    from trame.ui.html import DivLayout
    from trame.widgets import rca

    scene = peer.prepared(case.scene, shaded)
    drawn = peer.Vtk(case, scene, shaded)
    drawn.window.SetSize(edge, edge)
    shown = []

    class Area:
        """What trame-rca asks of a source of pictures."""

        seq = 0

        @property
        def img_cols_rows(self):
            import numpy as np
            import vtk
            from vtk.util.numpy_support import vtk_to_numpy
            drawn.window.Render()
            pixels = vtk.vtkUnsignedCharArray()
            drawn.window.GetRGBACharPixelData(0, 0, edge - 1, edge - 1, 0, pixels)
            image = np.ascontiguousarray(vtk_to_numpy(pixels).reshape(edge, edge, 4)[::-1])[..., :3]
            shown.append(self.seq)
            return image, edge, edge

        def process_resize_event(self, width, height):
            pass

        def process_interaction_event(self, event):
            self.seq = event["seq"]
            drawn.set_camera(peer.orbit(scene, event["angle"]))

    server = get_server(client_type="vue3")
    area = Area()
    with DivLayout(server):
        widget = rca.RemoteControlledArea(name="view", display="image")
    handler = widget.create_view_handler(area, encoder="turbo-jpeg", target_fps=60, interactive_quality=85, still_quality=85)
    push = handler.push

    def push_numbered(content, meta):
        # Pictures leave in the order they were drawn in.
        push(content, {**meta, "seq": shown.pop(0)})

    handler.push = push_numbered
    handler._scheduler.set_push_callback(push_numbered)
    server.start(port=port, open_browser=False, show_connection_info=False, timeout=0)


class Measured:
    """What a viewer gets."""

    def __init__(self):
        self.sent, self.latencies, self.bytes, self.pixels = [], [], [], []
        self.began = time.perf_counter()

    def counts(self):
        return time.perf_counter() - self.began >= WARM_UP

    def is_over(self):
        return time.perf_counter() - self.began >= WARM_UP + SECONDS

    def frame(self, seq, size, pixels):
        now = time.perf_counter()
        while self.sent and self.sent[0][0] <= seq:
            _, at = self.sent.pop(0)
            if self.counts():
                self.latencies.append(1e3 * (now - at))
        if self.counts():
            self.bytes.append(size)
            self.pixels.append(pixels)

    def row(self, *names):
        latencies = sorted(self.latencies)
        at = lambda share: round(latencies[int(share * (len(latencies) - 1))], 1) if latencies else math.nan
        return [*names, round(len(self.bytes) / SECONDS, 2), at(0.5), at(0.95),
                round(statistics.mean(self.bytes)) if self.bytes else math.nan,
                round(statistics.mean(self.pixels)) if self.pixels else math.nan]


async def inputs(measured, send):
    """Cameras at a steady rate: numbers from 2, and the angle they stand at."""
    seq = 1
    while not measured.is_over():
        seq += 1
        measured.sent.append((seq, time.perf_counter()))
        await send(seq, TURN * seq)
        # What was delayed is made up for, as the hand of a person would.
        due = measured.began + (seq - 1) / INPUTS_PER_SECOND
        await asyncio.sleep(max(0.0, due - time.perf_counter()))


async def measure_trame(port):
    def message(identifier, method, *arguments):
        body = msgpack.packb({"wslink": "1.0", "id": identifier, "method": method, "args": list(arguments), "kwargs": {}})
        return os.urandom(4) + struct.pack("<II", 0, len(body)) + body

    async with aiohttp.ClientSession() as session:
        async with session.ws_connect(f"http://127.0.0.1:{port}/ws", max_msg_size=0) as socket:
            await socket.send_bytes(message("system:c0:0", "wslink.hello", {"secret": "wslink-secret"}))
            await socket.receive()
            measured = Measured()
            numbers = iter(range(1, 1 << 30))

            async def call(method, *arguments):
                await socket.send_bytes(message(f"rpc:c0:{next(numbers)}", method, *arguments))

            await call("trame.rca.size", "view", "here", {"w": SIZE, "h": SIZE, "p": 1})
            sender = asyncio.create_task(inputs(measured, lambda seq, angle: call(
                "trame.rca.event", "view", "here", {"type": "MouseMove", "seq": seq, "angle": angle})))
            pending = {}
            while not measured.is_over():
                try:
                    received = await socket.receive(timeout=1)
                except asyncio.TimeoutError:
                    continue
                if received.type != aiohttp.WSMsgType.BINARY:
                    raise RuntimeError(f"trame closed the connection: {received}")
                identifier, offset, total = struct.unpack("<III", received.data[:12])
                whole = pending.setdefault(identifier, bytearray(total))
                whole[offset:offset + len(received.data) - 12] = received.data[12:]
                if offset + len(received.data) - 12 < total:
                    continue
                decoded = msgpack.unpackb(bytes(pending.pop(identifier)))
                result = decoded.get("result")
                if not str(decoded.get("id", "")).startswith("publish:trame.rca.topic.stream") or not result["content"]:
                    continue
                meta = result["meta"]
                measured.frame(meta["seq"], total + 12, meta.get("w", SIZE) * meta.get("h", SIZE))
            await sender
    return measured


async def measure_tyndall(port, scene):
    async with aiohttp.ClientSession() as session:
        base = f"http://127.0.0.1:{port}/api/v1/sessions"
        async with session.post(base, json={"scene": scene}) as answer:
            created = await answer.json()
            if answer.status != 201:
                raise RuntimeError(created)
        async with session.ws_connect(f"{base}/{created['id']}/view", max_msg_size=0) as socket:
            await socket.send_json({"type": "hello", "protocol": 1})
            await socket.send_json({"type": "viewport", "seq": 1, "width": SIZE, "height": SIZE, "pixel_ratio": 1})
            measured = Measured()
            sender = asyncio.create_task(inputs(measured, lambda seq, angle: socket.send_json(
                {"type": "camera", "seq": seq, "camera": peer.orbit(scene, angle)})))
            while not measured.is_over():
                try:
                    received = await socket.receive(timeout=1)
                except asyncio.TimeoutError:
                    continue
                if received.type == aiohttp.WSMsgType.TEXT:
                    continue
                if received.type != aiohttp.WSMsgType.BINARY:
                    raise RuntimeError(f"the service closed the connection: {received}")
                header = FRAME_HEADER.unpack_from(received.data)
                frame, seq, width, height = header[4], header[5], header[11], header[12]
                await socket.send_json({"type": "ack", "frame": frame, "decode_millis": 0})
                measured.frame(seq, len(received.data), width * height)
            await sender
    return measured


async def until_open(port, process):
    for _ in range(600):
        if process.poll() is not None:
            raise RuntimeError("the server ended at once")
        try:
            _, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.close()
            return
        except OSError:
            await asyncio.sleep(0.1)
    raise RuntimeError("the server does not listen")


def with_server(command, port, measure):
    process = subprocess.Popen([str(part) for part in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        async def run():
            await until_open(port, process)
            return await measure()
        return asyncio.run(run())
    finally:
        process.terminate()
        process.wait(20)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--binary", default=ROOT / "target/release/tyndall", type=pathlib.Path)
    arguments.add_argument("--out", default=pathlib.Path("bench-out"), type=pathlib.Path)
    arguments.add_argument("--port", default=8765, type=int)
    arguments.add_argument("--serve-trame", nargs=2, metavar=("SHADING", "EDGE"), help=argparse.SUPPRESS)
    arguments = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        case = scene_of(arguments.binary, folder)
        if arguments.serve_trame:
            shading, edge = arguments.serve_trame
            # trame reads the command line, too.
            sys.argv = sys.argv[:1]
            serve_trame(case, shading == "shaded", int(edge), arguments.port)
            return
        rows = []
        for shading in ("unshaded", "shaded"):
            scene = peer.prepared(case.scene, shading == "shaded")
            # The service computes the same volume itself.
            scene["volume"] = {"builtin": case.name, "dims": [128, 128, 128]}
            ours = with_server([arguments.binary, "serve", "--listen", f"127.0.0.1:{arguments.port}", "--data", folder / f"data-{shading}"],
                               arguments.port, lambda: measure_tyndall(arguments.port, scene))
            rows.append(ours.row("Tyndall", shading, f"{SIZE} x {SIZE}, smaller while it moves"))
            print(*rows[-1], flush=True)
            chosen = max(16, round(math.sqrt(rows[-1][-1])))
            for edge, size in ((SIZE, f"{SIZE} x {SIZE}"), (chosen, f"{chosen} x {chosen}")):
                command = [sys.executable, __file__, "--binary", arguments.binary, "--port", arguments.port, "--serve-trame", shading, edge]
                theirs = with_server(command, arguments.port, lambda: measure_trame(arguments.port))
                rows.append(theirs.row("trame", shading, size))
                print(*rows[-1], flush=True)
    columns = ["server", "shading", "picture", "frames_per_second", "latency_p50_ms", "latency_p95_ms", "bytes_per_frame", "pixels"]
    doctor = subprocess.run([arguments.binary, "doctor"], capture_output=True, text=True).stdout.splitlines()
    import importlib.metadata as packages
    about = {"device": next((line.removeprefix("GPU: ") for line in doctor if line.startswith("GPU: ")), ""),
             "machine": f"{os.cpu_count()} cores, {platform.machine()}", "seconds": SECONDS, "inputs_per_second": INPUTS_PER_SECOND,
             **{name: packages.version(name) for name in ("trame", "trame-rca", "vtk")}}
    arguments.out.mkdir(parents=True, exist_ok=True)
    with open(arguments.out / "trame.csv", "w", newline="") as file:
        csv.writer(file).writerows([columns, *rows])
    report = {"about": about, "rows": [dict(zip(columns, row)) for row in rows]}
    (arguments.out / "trame.json").write_text(json.dumps(report, indent=2) + "\n")


if __name__ == "__main__":
    main()
