"""Tyndall's ray caster against VTK's CPU ray caster, on the same voxels, transfer function, camera and step.

    python3 -m venv venv && venv/bin/pip install vtk==9.7.2 numpy pillow
    make build && venv/bin/python tests/peers/vtk_ray_caster.py --out docs/benchmarks

Not part of the test suite. Every cell is measured on both sides in turns, FRAMES times, and the median is
kept; a frame includes reading the picture back. VTK works on all cores of the CPU
(vtkFixedPointVolumeRayCastMapper, 16-bit); Tyndall on whatever device `tyndall doctor` names. Both take
one sample per pixel, rays of one voxel's step. A second table has both at shorter steps, with the error
of each against its own picture at FINE_STEP: what a time buys. The third volume is a CT scan from the shared test data
(TYNDALL_TEST_DATA, default ../shared/data); without it, it is left out, and this is said.
"""

import argparse
import csv
import gzip
import json
import math
import os
import pathlib
import statistics
import subprocess
import tempfile
import time

import numpy as np
import vtk
from PIL import Image, ImageDraw
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

ROOT = pathlib.Path(__file__).resolve().parents[2]
SIZE = 512
FRAMES = 7
# Voxels; the finest is what the others are held against.
STEPS = (1.0, 0.5, 0.25, 0.125)
FINE_STEP = 0.0625


def read_nrrd(path):
    """Voxels [z, y, x] of an attached raw NRRD as `tyndall import -o` writes it."""
    data = path.read_bytes()
    header, body = data.split(b"\n\n", 1)
    fields = dict(line.split(": ", 1) for line in header.decode().splitlines() if ": " in line)
    kinds = {"uint8": "u1", "uint16": "<u2", "int16": "<i2", "float": "<f4", "unsigned char": "u1",
             "unsigned short": "<u2", "short": "<i2"}
    if fields["encoding"] == "gzip":
        body = gzip.decompress(body)
    dims = [int(n) for n in fields["sizes"].split()]
    return np.frombuffer(body, kinds[fields["type"]]).reshape(dims[::-1])


class Case:
    """One volume with its transfer function."""

    def __init__(self, name, voxels, scene, spacing):
        self.name, self.voxels, self.scene, self.spacing = name, voxels, scene, spacing


def cases(binary, folder):
    for name in ("buckyball", "vessel_tree"):
        path = folder / f"{name}.nrrd"
        subprocess.run([binary, "import", f"builtin:{name}:128", "-o", path], check=True, capture_output=True)
        scene = json.loads((ROOT / f"server/scene/scenes/{name}.json").read_text())
        scene["volume"] = {"file": str(path)}
        voxels = read_nrrd(path)
        # The showcase's value range is in data values, as voxels are.
        yield Case(name, voxels, scene, (1, 1, 1))
    data = pathlib.Path(os.environ.get("TYNDALL_TEST_DATA", ROOT / "../shared/data")) / "manix128"
    if not data.exists():
        print(f"LEFT OUT: bone-like CT, {data} is not there")
        return
    voxels = np.frombuffer((data / "manix128.raw").read_bytes(), "u1")[-128 * 128 * 115:].reshape(115, 128, 128)
    points = [(0.0, 0), (0.42, 0), (0.55, 60), (1.0, 300)]
    scene = {
        "version": 1,
        "volume": {"file": str(data / "manix128.raw"), "dims": [128, 128, 115], "type": "uint8"},
        "value_range": [0, 255], "spacing": [0.49, 0.49, 0.67],
        "transfer_function": {"points": [{"s": s, "extinction": e, "albedo": [0.95, 0.9, 0.8]} for s, e in points]},
        "camera": {"position": [-1.5, 0.6, 0.5], "target": [0, 0, 0], "up": [0, 0, 1], "fov_y_degrees": 36},
        "background": [0.01, 0.01, 0.015],
    }
    yield Case("bone_like_ct", voxels, scene, (0.49, 0.49, 0.67))


def prepared(scene, shaded, step=1.0):
    """The scene as both sides can draw it: one directional light, or light from everywhere."""
    scene = json.loads(json.dumps(scene))
    scene["materials"] = {"m": {
        "surface": 1.0 if shaded else 0.0,
        "brdf": {"type": "blinn_phong", "diffuse": 0.8, "specular": 0.1, "exponent": 20}}}
    for point in scene["transfer_function"]["points"]:
        point["material"] = "m"
    camera = scene["camera"]
    forward = np.subtract(camera["target"], camera["position"])
    headlight = {"id": "head", "type": "directional", "direction": list(forward), "irradiance": [math.pi] * 3}
    room = {"id": "room", "type": "environment", "radiance": [0.2] * 3 if shaded else [1.0] * 3}
    scene["lights"] = [headlight, room] if shaded else [room]
    scene["sampling"] = {"step_voxels": step, "samples_per_pixel": 1}
    scene["film"] = {"tone_mapping": "linear"}
    return scene


def orbit(scene, angle):
    """The camera turned about the target around its up axis."""
    camera = json.loads(json.dumps(scene["camera"]))
    offset = np.subtract(camera["position"], camera["target"])
    axis = np.array(camera["up"], float) / np.linalg.norm(camera["up"])
    turned = (offset * math.cos(angle) + np.cross(axis, offset) * math.sin(angle)
              + axis * axis.dot(offset) * (1 - math.cos(angle)))
    camera["position"] = list(np.add(camera["target"], turned))
    return camera


def edited(points, factor):
    """The transfer function with its extinctions multiplied."""
    return [{**point, "extinction": point["extinction"] * factor} for point in points]


class Tyndall:
    def __init__(self, binary, folder):
        self.binary, self.folder = binary, folder

    def run(self, scene, patches, picture):
        path = self.folder / "scene.json"
        path.write_text(json.dumps(scene))
        command = [self.binary, "render", path, "-o", picture, "--size", f"{SIZE}x{SIZE}", "--stats", self.folder / "stats.json"]
        for index, patch in enumerate(patches):
            (self.folder / f"patch{index}.json").write_text(json.dumps(patch))
            command += ["--edit", self.folder / f"patch{index}.json"]
        subprocess.run(command, check=True, capture_output=True)
        stats = json.loads((self.folder / "stats.json").read_text())
        return [edit["millis"] + edit["picture_millis"] for edit in stats["edits"]], stats["device"]["name"], stats["initial"]["counters"]

    def camera_times(self, scene, picture):
        return self.run(scene, [{"camera": orbit(scene, 0.05 * (1 + i))} for i in range(FRAMES)], picture)

    def edit_times(self, scene, picture):
        points = scene["transfer_function"]["points"]
        patches = [{"transfer_function": {"points": edited(points, 1 - 0.02 * (1 + i))}} for i in range(FRAMES)]
        return self.run(scene, patches, picture)


class Vtk:
    """The same scene in VTK's fixed-point ray caster."""

    def __init__(self, case, scene, shaded):
        self.scene, self.shaded = scene, shaded
        nz, ny, nx = case.voxels.shape
        # The volume's longest edge is 1 and its centre the origin, as in Tyndall.
        size = np.multiply((nx, ny, nz), case.spacing)
        spacing = np.divide(case.spacing, size.max())
        self.voxel = spacing.min()
        image = vtk.vtkImageData()
        image.SetDimensions(nx, ny, nz)
        image.SetSpacing(*spacing)
        image.SetOrigin(*(-0.5 * np.multiply((nx, ny, nz), spacing) + 0.5 * spacing))
        low, high = scene["value_range"]
        self.low, self.high = low, high
        # Fixed point takes 8 or 16 bits; floats are brought to 16.
        voxels = case.voxels
        self.scale, self.offset = 1.0, 0.0
        if voxels.dtype.kind == "f":
            self.scale, self.offset = 65535.0 / (voxels.max() - voxels.min()), float(voxels.min())
            voxels = ((voxels - self.offset) * self.scale).astype(np.uint16)
        image.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(voxels).ravel(), deep=True))
        self.mapper = vtk.vtkFixedPointVolumeRayCastMapper()
        self.mapper.SetInputData(image)
        self.mapper.AutoAdjustSampleDistancesOff()
        self.mapper.SetImageSampleDistance(1.0)
        self.mapper.SetSampleDistance(self.voxel)
        self.property = vtk.vtkVolumeProperty()
        self.property.SetInterpolationTypeToLinear()
        self.property.SetScalarOpacityUnitDistance(self.voxel)
        if shaded:
            self.property.ShadeOn()
            self.property.SetAmbient(0.2)
            self.property.SetDiffuse(0.8)
            self.property.SetSpecular(0.1)
            self.property.SetSpecularPower(20)
        self.set_points(scene["transfer_function"]["points"])
        volume = vtk.vtkVolume()
        volume.SetMapper(self.mapper)
        volume.SetProperty(self.property)
        self.renderer = vtk.vtkRenderer()
        self.renderer.AddVolume(volume)
        self.renderer.SetBackground(0, 0, 0)
        self.window = vtk.vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)
        self.window.SetSize(SIZE, SIZE)
        self.window.AddRenderer(self.renderer)
        self.set_camera(scene["camera"])

    def set_points(self, points):
        opacity, color = vtk.vtkPiecewiseFunction(), vtk.vtkColorTransferFunction()
        stored = lambda s: (self.low + s * (self.high - self.low) - self.offset) * self.scale
        s = np.array([p["s"] for p in points])
        for at in np.linspace(0, 1, 1025):
            extinction = np.interp(at, s, [p["extinction"] for p in points])
            opacity.AddPoint(stored(at), 1 - math.exp(-extinction * self.voxel))
            color.AddRGBPoint(stored(at), *(np.interp(at, s, [p["albedo"][c] for p in points]) for c in range(3)))
        self.property.SetScalarOpacity(opacity)
        self.property.SetColor(color)

    def set_camera(self, camera):
        view = self.renderer.GetActiveCamera()
        view.SetPosition(*camera["position"])
        view.SetFocalPoint(*camera["target"])
        view.SetViewUp(*camera["up"])
        view.SetViewAngle(camera["fov_y_degrees"])
        self.renderer.ResetCameraClippingRange()

    def frame(self):
        self.window.Render()
        pixels = vtk.vtkUnsignedCharArray()
        self.window.GetRGBACharPixelData(0, 0, SIZE - 1, SIZE - 1, 0, pixels)
        return vtk_to_numpy(pixels).reshape(SIZE, SIZE, 4)[::-1, :, :3]

    def set_step(self, step):
        self.mapper.SetSampleDistance(self.voxel * step)

    def timed(self, change):
        times = []
        self.frame()
        for i in range(FRAMES):
            began = time.perf_counter()
            change(i)
            self.frame()
            times.append(1e3 * (time.perf_counter() - began))
        return times

    def camera_times(self):
        return self.timed(lambda i: self.set_camera(orbit(self.scene, 0.05 * (1 + i))))

    def edit_times(self):
        points = self.scene["transfer_function"]["points"]
        return self.timed(lambda i: self.set_points(edited(points, 1 - 0.02 * (1 + i))))


def relative_error(picture, fine):
    """Relative L2 difference of two pictures' pixel values."""
    picture, fine = np.asarray(picture, float), np.asarray(fine, float)
    return float(np.linalg.norm(picture - fine) / np.linalg.norm(fine))


def against_error(case, shaded, ours, folder):
    """[who, step, milliseconds of a camera edit, error against the own picture at FINE_STEP] of both."""
    scene = prepared(case.scene, shaded)
    peer = Vtk(case, scene, shaded)

    def still(step):
        ours.run(prepared(case.scene, shaded, step), [], folder / "still.png")
        return np.asarray(Image.open(folder / "still.png").convert("RGB"))

    def peer_still(step):
        peer.set_step(step)
        peer.set_camera(scene["camera"])
        return np.array(peer.frame())

    fine, peer_fine = still(FINE_STEP), peer_still(FINE_STEP)
    for step in STEPS:
        error = relative_error(peer_still(step), peer_fine)
        yield ["VTK", step, statistics.median(peer.camera_times()), error]
        error = relative_error(still(step), fine)
        times, _, _ = ours.camera_times(prepared(case.scene, shaded, step), folder / "edited.png")
        yield ["Tyndall", step, statistics.median(times), error]


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--binary", default=ROOT / "target/release/tyndall", type=pathlib.Path)
    arguments.add_argument("--out", default=pathlib.Path("bench-out"), type=pathlib.Path)
    arguments = arguments.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    rows, errors, pictures, device = [], [], [], ""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        ours = Tyndall(arguments.binary, folder)
        for case in cases(arguments.binary, folder):
            for shaded in (False, True):
                scene = prepared(case.scene, shaded)
                peer = Vtk(case, scene, shaded)
                label = f"{case.name}, {'shaded' if shaded else 'unshaded'}"
                for edit in ("camera", "transfer_function"):
                    # In turns, so that a busy moment of the machine meets both.
                    theirs_times, our_times = [], []
                    for _ in range(2):
                        theirs_times += peer.camera_times() if edit == "camera" else peer.edit_times()
                        measure = ours.camera_times if edit == "camera" else ours.edit_times
                        times, device, _ = measure(scene, folder / "edited.png")
                        our_times += times
                    vtk_ms, tyndall_ms = statistics.median(theirs_times), statistics.median(our_times)
                    rows.append([case.name, "shaded" if shaded else "unshaded", edit, round(vtk_ms, 1),
                                 round(tyndall_ms, 1), round(tyndall_ms / vtk_ms, 2)])
                    print(*rows[-1])
                peer.set_camera(scene["camera"])
                peer.set_points(scene["transfer_function"]["points"])
                theirs = Image.fromarray(np.ascontiguousarray(peer.frame()))
                ours.run(scene, [], folder / "ours.png")
                for who, step, millis, error in against_error(case, shaded, ours, folder):
                    errors.append([case.name, "shaded" if shaded else "unshaded", who, step, round(millis, 1), round(error, 5)])
                    print(*errors[-1])
                pictures.append((label, theirs, Image.open(folder / "ours.png").convert("RGB")))
    columns = ["volume", "shading", "edit", "vtk_millis", "tyndall_millis", "tyndall_over_vtk"]
    with open(arguments.out / "vtk.csv", "w", newline="") as file:
        csv.writer(file).writerows([columns, *rows])
    about = {"device": device, "vtk": vtk.vtkVersion.GetVTKVersion(), "cores": os.cpu_count(),
             "image": [SIZE, SIZE], "step_voxels": 1, "frames": 2 * FRAMES}
    error_columns = ["volume", "shading", "renderer", "step_voxels", "millis", "relative_error"]
    with open(arguments.out / "vtk-error.csv", "w", newline="") as file:
        csv.writer(file).writerows([error_columns, *errors])
    report = {"about": about, "rows": [dict(zip(columns, row)) for row in rows],
              "against_error": [dict(zip(error_columns, row)) for row in errors]}
    (arguments.out / "vtk.json").write_text(json.dumps(report, indent=2))
    edge, text = 256, 18
    sheet = Image.new("RGB", (2 * edge, len(pictures) * (edge + text)))
    for index, (label, theirs, our) in enumerate(pictures):
        top = index * (edge + text)
        ImageDraw.Draw(sheet).text((4, top + 3), f"{label}: VTK, Tyndall", fill=(220, 220, 220))
        for column, picture in enumerate((theirs, our)):
            sheet.paste(picture.resize((edge, edge)), (column * edge, top + text))
    sheet.save(arguments.out / "vtk.png")


if __name__ == "__main__":
    main()
