"""Tyndall's service against trame's remote rendering: viewers that turn a volume, over WebSockets on this machine.

    python3 -m venv venv && venv/bin/pip install trame trame-rca vtk aiohttp msgpack pillow PyTurboJPEG
    make build && venv/bin/python tests/peers/trame_remote.py --out docs/benchmarks

Not part of the test suite. PyTurboJPEG needs libturbojpeg (Debian: libturbojpeg0); without it trame encodes with Pillow,
which is slower. Both servers are asked alike: a camera every 1/60 s that turns about the volume, for
SECONDS after a warm-up. Counted are pictures that arrive, their bytes, and for each camera the time until a picture
arrives that shows it or a newer one. Volume, transfer function, light and viewport are the same; the step is one voxel.
Two scenes: the buckyball of 128 voxels along an edge at 512 x 512, one viewer; and one with next to nothing to draw,
a homogeneous box of 8 voxels at 1280 x 720, one viewer and four, each of which turns a view of its own. In Tyndall
those are viewers of one session of one service. A trame server has one view for all, so that each viewer has a server
of its own, which uses more of the machine's cores than one would.

trame draws with VTK's CPU ray caster, which beats its GPU mapper where there is no GPU, and sends JPEG by
trame-rca's scheduler and encoder, as its own widgets do; the camera is set by the interaction message, so that nothing
is lost to mouse handling. It draws every picture whole. Tyndall shrinks pictures while the camera moves until they come
in time: the column `pixels` says how many of the viewport's pixels a picture has on average. So a second trame case
draws at the size that Tyndall chose. Of several viewers the rows tell pictures a second of the slowest and of all
together, and latencies of all.
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
BUCKYBALL_SIZE = (512, 512)
TRIVIAL_SIZE = (1280, 720)
TRIVIAL_EDGE = 8
TRIVIAL_VIEWERS = (1, 4)
SECONDS = 15
WARM_UP = 4
INPUTS_PER_SECOND = 60
TURN = 0.02
FRAME_HEADER = struct.Struct("<IHBBIIIIfIfHHHHIIIII")


def cases_of(binary, folder):
    """The cases both draw, by name: voxels and scene. The service computes the same volumes itself."""
    buckyball = next(iter(peer.cases(binary, folder)))
    buckyball.scene["volume"] = {"builtin": "buckyball", "dims": [128] * 3}
    path = folder / "trivial.nrrd"
    subprocess.run([binary, "import", f"builtin:homogeneous:{TRIVIAL_EDGE}", "-o", path], check=True, capture_output=True)
    scene = json.loads((ROOT / "server/scene/scenes/homogeneous.json").read_text())
    scene["volume"] = {"builtin": "homogeneous", "dims": [TRIVIAL_EDGE] * 3}
    return {"buckyball": buckyball, "trivial": peer.Case("trivial", peer.read_nrrd(path), scene, (1, 1, 1))}


def serve_trame(case, shaded, size, port):
    """Runs a trame server until it is killed."""
    from trame.app import get_server
    from trame.ui.html import DivLayout
    from trame.widgets import rca

    scene = peer.prepared(case.scene, shaded)
    drawn = peer.Vtk(case, scene, shaded)
    width, height = size
    drawn.window.SetSize(width, height)
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
            drawn.window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, pixels)
            image = np.ascontiguousarray(vtk_to_numpy(pixels).reshape(height, width, 4)[::-1])[..., :3]
            shown.append(self.seq)
            return image, width, height

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


def row(viewers, *names):
    """What so many viewers got, as a row of the table."""
    latencies = sorted(millis for viewer in viewers for millis in viewer.latencies)
    at = lambda share: round(latencies[int(share * (len(latencies) - 1))], 1) if latencies else math.nan
    counts = [len(viewer.bytes) / SECONDS for viewer in viewers]
    mean = lambda numbers: round(statistics.mean(numbers)) if numbers else math.nan
    return [*names, len(viewers), round(min(counts), 2), round(sum(counts), 2), at(0.5), at(0.95),
            mean([size for viewer in viewers for size in viewer.bytes]), mean([size for viewer in viewers for size in viewer.pixels])]


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


async def measure_trame(port, size):
    width, height = size

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

            await call("trame.rca.size", "view", "here", {"w": width, "h": height, "p": 1})
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
                measured.frame(meta["seq"], total + 12, meta.get("w", width) * meta.get("h", height))
            await sender
    return measured


async def measure_tyndall(port, scene, size, viewers):
    base = f"http://127.0.0.1:{port}/api/v1/sessions"
    async with aiohttp.ClientSession() as session:
        async with session.post(base, json={"scene": scene}) as answer:
            created = await answer.json()
            if answer.status != 201:
                raise RuntimeError(created)
    address = f"{base}/{created['id']}/view"
    return await asyncio.gather(*(measure_viewer(address, scene, size) for _ in range(viewers)))


async def measure_viewer(address, scene, size):
    async with aiohttp.ClientSession() as session:
        async with session.ws_connect(address, max_msg_size=0) as socket:
            await socket.send_json({"type": "hello", "protocol": 1})
            await socket.send_json({"type": "viewport", "seq": 1, "width": size[0], "height": size[1], "pixel_ratio": 1})
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


async def measure_trames(port, size, viewers):
    return await asyncio.gather(*(measure_trame(port + index, size) for index in range(viewers)))


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


def with_servers(commands, port, measure):
    """Runs servers on this port and the next ones while something is measured."""
    processes = [subprocess.Popen([str(part) for part in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for command in commands]
    try:
        async def run():
            for index, process in enumerate(processes):
                await until_open(port + index, process)
            return await measure()
        return asyncio.run(run())
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait(20)


class Bench:
    """Measures cases and keeps their rows."""

    def __init__(self, binary, port, folder):
        self.binary, self.port, self.folder, self.rows = binary, port, folder, []

    def ours(self, name, scene, size, viewers, shading):
        data = self.folder / f"data-{name}-{shading}-{viewers}"
        command = [self.binary, "serve", "--listen", f"127.0.0.1:{self.port}", "--data", data]
        measured = with_servers([command], self.port, lambda: measure_tyndall(self.port, scene, size, viewers))
        return self.keep(measured, "Tyndall", name, shading, f"{size[0]} x {size[1]}, smaller while it moves")

    def theirs(self, name, size, viewers, shading):
        width, height = size
        serve = lambda index: [sys.executable, __file__, "--binary", self.binary, "--port", self.port + index,
                               "--serve-trame", name, shading, width, height]
        measured = with_servers(map(serve, range(viewers)), self.port, lambda: measure_trames(self.port, size, viewers))
        self.keep(measured, "trame", name, shading, f"{width} x {height}")

    def keep(self, measured, *names):
        self.rows.append(row(measured, *names))
        print(*self.rows[-1], flush=True)
        return self.rows[-1][-1]

    def compare(self, case, name, size, viewers, shading):
        scene = peer.prepared(case.scene, shading == "shaded")
        pixels = self.ours(name, scene, size, viewers, shading)
        self.theirs(name, size, viewers, shading)
        shrink = math.sqrt(pixels / (size[0] * size[1]))
        if shrink < 0.95:
            self.theirs(name, tuple(max(16, round(edge * shrink)) for edge in size), viewers, shading)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--binary", default=ROOT / "target/release/tyndall", type=pathlib.Path)
    arguments.add_argument("--out", default=pathlib.Path("bench-out"), type=pathlib.Path)
    arguments.add_argument("--port", default=8765, type=int)
    arguments.add_argument("--serve-trame", nargs=4, metavar=("CASE", "SHADING", "WIDTH", "HEIGHT"), help=argparse.SUPPRESS)
    arguments = arguments.parse_args()
    load_at_the_start = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        cases = cases_of(arguments.binary, folder)
        if arguments.serve_trame:
            name, shading, width, height = arguments.serve_trame
            # trame reads the command line, too.
            sys.argv = sys.argv[:1]
            serve_trame(cases[name], shading == "shaded", (int(width), int(height)), arguments.port)
            return
        bench = Bench(arguments.binary, arguments.port, folder)
        for shading in ("unshaded", "shaded"):
            bench.compare(cases["buckyball"], "buckyball", BUCKYBALL_SIZE, 1, shading)
        for viewers in TRIVIAL_VIEWERS:
            bench.compare(cases["trivial"], "trivial", TRIVIAL_SIZE, viewers, "unshaded")
        rows = bench.rows
    columns = ["server", "scene", "shading", "picture", "viewers", "frames_per_second_slowest", "frames_per_second_all", "latency_p50_ms", "latency_p95_ms", "bytes_per_frame", "pixels"]
    doctor = subprocess.run([arguments.binary, "doctor"], capture_output=True, text=True).stdout.splitlines()
    import importlib.metadata as packages
    about = {"device": next((line.removeprefix("GPU: ") for line in doctor if line.startswith("GPU: ")), ""),
             "machine": f"{os.cpu_count()} cores, {platform.machine()}", "seconds": SECONDS, "inputs_per_second": INPUTS_PER_SECOND,
             "load_average": [round(load_at_the_start, 1), round(os.getloadavg()[0], 1)],
             **{name: packages.version(name) for name in ("trame", "trame-rca", "vtk")}}
    arguments.out.mkdir(parents=True, exist_ok=True)
    with open(arguments.out / "trame.csv", "w", newline="") as file:
        csv.writer(file).writerows([columns, *rows])
    report = {"about": about, "rows": [dict(zip(columns, row)) for row in rows]}
    (arguments.out / "trame.json").write_text(json.dumps(report, indent=2) + "\n")


if __name__ == "__main__":
    main()
