/** Clip box and clip planes in the picture: faces and planes are pulled where they are seen. */

import { OverlayHandle } from "../viewport/OverlayHandle";
import { useUi } from "../app/uiStore";
import type { Camera } from "../generated/proto";
import { normalize, rounded, type Triple } from "../scene/vec";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { frameOf } from "../viewport/camera";
import { along, isInside, pathThrough, seenAt, type ViewportSize } from "../viewport/screen";
import {
  anatomicalNames, edgesOf, faceCentre, gridNames, isSeen, outwards, planeCentre, planeOutline, WHOLE, withFace, type Axis, type Box, type Side,
} from "./clipBox";
import { cutShare, halfEdges, withCut } from "./clipPlanes";
import { setPlanes } from "./PlaneRows";

/** Share of the volume that an arrow key moves a face or a plane by. */
const KEY_STEP = 0.01;

const eyeOf = (camera: Camera) => (camera.orthographic_height === undefined ? { place: camera.position } : { towards: frameOf(camera).back });

export function ClipHandles({ viewport }: { viewport: ViewportSize }) {
  const wanted = useUi((ui) => ui.clipHandles);
  const clip = useSession((state) => state.scene?.clip);
  const camera = useSession((state) => state.scene?.camera);
  const dataset = useSession((state) => state.dataset);
  const spacing = useSession((state) => state.scene?.spacing);
  if (!wanted || !clip || !camera || viewport.height === 0) return null;
  const half = halfEdges(dataset, spacing);
  const box = clip.box ?? WHOLE;
  const eye = eyeOf(camera);
  const seen = (axis: Axis, side: Side) => isSeen(faceCentre(box, axis, side, half), outwards(axis, side), eye);
  const edges = edgesOf(box, half).map(({ ends, faces }) => ({ path: pathThrough(camera, viewport, ends, false), behind: !faces.some(([axis, side]) => seen(axis, side)) }));
  return (
    <>
      <svg className="overlay-lines" width={viewport.width} height={viewport.height} aria-hidden="true" data-testid="clip-lines">
        {edges.map(({ path, behind }, index) => <path key={index} d={path} data-behind={behind} />)}
        {clip.planes.map((plane, index) => <path key={`plane-${index}`} d={pathThrough(camera, viewport, planeOutline(plane, half), true)} data-plane />)}
      </svg>
      {([0, 1, 2] as const).flatMap((axis) => ([0, 1] as const).map((side) => (
        <FaceHandle key={`${axis}-${side}`} box={box} axis={axis} side={side} half={half} camera={camera} viewport={viewport} behind={!seen(axis, side)} names={dataset?.anatomical ? anatomicalNames : gridNames} />
      )))}
      {clip.planes.map((_, index) => <PlaneHandle key={index} index={index} half={half} camera={camera} viewport={viewport} />)}
    </>
  );
}

interface Seen {
  half: Triple;
  camera: Camera;
  viewport: ViewportSize;
}

function FaceHandle({ box, axis, side, half, camera, viewport, behind, names }: Seen & { box: Box; axis: Axis; side: Side; behind: boolean; names: readonly string[] }) {
  const centre = faceCentre(box, axis, side, half);
  const at = seenAt(camera, viewport, centre);
  if (!at || !isInside(at, viewport)) return null;
  const move = (from: Box, by: number, key: string | null) => session.edit({ clip: { box: withFace(from, axis, side, by) } }, key);
  const axisDirection = outwards(axis, 1);
  return (
    <OverlayHandle
      at={at}
      kind={behind ? "face-behind" : "face"}
      label={`Clip ${names[axis] ?? ""}, ${side === 0 ? "from" : "to"}: drag`}
      text={`${Math.round(box[side][axis] * 100)} %`}
      value={box[side][axis]}
      range={[0, 1]}
      testId={`clip-face-${gridNames[axis]}-${side === 0 ? "from" : "to"}`}
      grab={() => (dx, dy) => move(box, along(camera, viewport, centre, axisDirection, dx, dy) / (2 * half[axis]), null)}
      nudge={(right, up) => move(box, (right + up) * KEY_STEP, `face-${axis}-${side}`)}
    />
  );
}

function PlaneHandle({ index, half, camera, viewport }: Seen & { index: number }) {
  const planes = useSession((state) => state.scene?.clip.planes);
  const plane = planes?.[index];
  if (!planes || !plane) return null;
  const centre = planeCentre(plane, half);
  const at = seenAt(camera, viewport, centre);
  if (!at || !isInside(at, viewport)) return null;
  const share = cutShare(plane, half);
  const put = (offset: number) => setPlanes(planes.map((other, i) => (i === index ? { ...plane, offset: rounded(offset, 5) } : other)));
  return (
    <OverlayHandle
      at={at}
      kind="plane"
      label={`Clip plane ${index + 1}: drag`}
      text={`cuts away ${Math.round(share * 100)} %`}
      value={share}
      range={[0, 1]}
      testId={`clip-plane-handle-${index}`}
      grab={() => (dx, dy) => put(plane.offset + along(camera, viewport, centre, normalize(plane.normal), dx, dy))}
      nudge={(right, up) => setPlanes(planes.map((other, i) => (i === index ? withCut(plane, Math.min(1, Math.max(0, share + (right + up) * KEY_STEP)), half) : other)), `plane-${index}`)}
    />
  );
}
