/** Turntable: what is drawn and how, pictures of the way ahead of time, and the export under way. */

import { Button, Modal, NativeSelect, Progress } from "@mantine/core";
import { useEffect, useState } from "react";
import { exportFileUrl } from "../api/rest";
import { NumberField, Row } from "../app/controls";
import { baseName } from "../app/files";
import { useUi } from "../app/uiStore";
import { formatBytes } from "../datasets/format";
import type { Camera, ExportFormat, SceneFile } from "../generated/proto";
import { isTraced } from "../quality/methods";
import { askPreview, previewSize } from "../session/previews";
import { useSession } from "../session/store";
import { beginTurntable, dropTurntable, useTurntable } from "./store";
import { inWords, isUnderWay, LIMITS, progressInWords, refusal, requestOf, suggested, turned, type TurntableSettings } from "./turntable";

/** Shares of the way that pictures are shown of. */
const SHOWN = [0, 0.25, 0.5, 0.75] as const;
/** Longest edge of such a picture, CSS pixels. */
const PICTURE_EDGE = 132;
/** Numbers are typed and pictures follow them: they wait until the person does, milliseconds. */
const TYPING_MILLIS = 300;

const formats: readonly { value: ExportFormat; label: string }[] = [
  { value: "apng", label: "Animated PNG, plays in browsers" },
  { value: "zip", label: "Zip of PNGs, one a picture" },
];

const close = (): void => void useUi.setState({ turntableOpen: false });

export function TurntableDialog() {
  const opened = useUi((ui) => ui.turntableOpen);
  return (
    <Modal opened={opened} onClose={close} title="Turntable" size={620} closeButtonProps={{ "aria-label": "Close" }} data-testid="turntable">
      <Content />
    </Modal>
  );
}

function Content() {
  const job = useTurntable((state) => state.job);
  const problem = useTurntable((state) => state.problem);
  const sessionId = useSession((state) => state.sessionId);
  const camera = useSession((state) => state.scene?.camera);
  const [settings, setSettings] = useState(() => startOf(useSession.getState().scene, useSession.getState().frame));
  if (!sessionId || !camera || !settings) return <p className="hint">There is no picture yet.</p>;
  const failure = problem ?? (job?.state === "failed" ? (job.problem?.detail ?? "It failed.") : null);
  return (
    <>
      {failure !== null && <p className="note note-danger" role="alert" data-testid="turntable-problem">{failure}</p>}
      {job && job.state !== "failed" ? <Job /> : <Settings settings={settings} change={(part) => setSettings({ ...settings, ...part })} sessionId={sessionId} camera={camera} />}
    </>
  );
}

function startOf(scene: SceneFile | null, frame: { viewport_width: number; viewport_height: number } | null): TurntableSettings | null {
  if (!scene || !frame) return null;
  const samples = isTraced(scene) ? scene.illumination.paths_per_pixel : scene.sampling.samples_per_pixel;
  return suggested({ width: frame.viewport_width, height: frame.viewport_height }, samples);
}

function Settings({ settings, change, sessionId, camera }: {
  settings: TurntableSettings;
  change: (part: Partial<TurntableSettings>) => void;
  sessionId: string;
  camera: Camera;
}) {
  const refused = refusal(settings);
  const begin = () => void beginTurntable(sessionId, requestOf(settings, camera));
  return (
    <>
      <p className="hint">The camera goes around the pivot, from the view on screen, about its upright axis. The service draws the pictures behind everything else it does; the dialog may be closed meanwhile.</p>
      <Way settings={settings} sessionId={sessionId} camera={camera} />
      <div className="turntable-fields">
        <Row label="Turns" hint="Negative: the other way"><NumberField label="Turns" value={settings.turns} min={-LIMITS.turns} max={LIMITS.turns} step={0.5} testId="turntable-turns" onChange={(turns) => change({ turns })} /></Row>
        <Row label="Length"><NumberField label="Length in seconds" value={settings.seconds} min={0} max={LIMITS.frames.max} step={1} suffix=" s" testId="turntable-seconds" onChange={(seconds) => change({ seconds })} /></Row>
        <Row label="Pictures a second"><NumberField label="Pictures a second" value={settings.framesPerSecond} whole min={LIMITS.rate.min} max={LIMITS.rate.max} testId="turntable-rate" onChange={(framesPerSecond) => change({ framesPerSecond: Math.round(framesPerSecond) })} /></Row>
        <Row label="Size">
          <NumberField label="Width in pixels" value={settings.width} whole min={1} max={LIMITS.edge} testId="turntable-width" onChange={(width) => change({ width: Math.round(width) })} />
          <span className="dim">×</span>
          <NumberField label="Height in pixels" value={settings.height} whole min={1} max={LIMITS.edge} testId="turntable-height" onChange={(height) => change({ height: Math.round(height) })} />
        </Row>
        <Row label="Samples" hint="Per pixel; of the path tracer, paths"><NumberField label="Samples per pixel" value={settings.samples} whole min={1} max={LIMITS.samples} testId="turntable-samples" onChange={(samples) => change({ samples: Math.round(samples) })} /></Row>
        <Row label="File"><NativeSelect aria-label="File" data={formats} value={settings.format} data-testid="turntable-format" onChange={(event) => change({ format: formats.find(({ value }) => value === event.currentTarget.value)?.value ?? "apng" })} /></Row>
      </div>
      <div className="turntable-foot">
        <span className={refused === null ? "dim" : "note-danger"} role="status" data-testid="turntable-words">{refused ?? inWords(settings)}</span>
        <Button onClick={begin} disabled={refused !== null} data-testid="turntable-begin">Draw</Button>
      </div>
    </>
  );
}

/** Small pictures of the way, drawn by the service. */
function Way({ settings, sessionId, camera }: { settings: TurntableSettings; sessionId: string; camera: Camera }) {
  const { width, height, turns } = useSettled(settings);
  const shrink = PICTURE_EDGE / Math.max(width, height);
  const size = previewSize(Math.max(1, width * shrink), Math.max(1, height * shrink));
  return (
    <div className="turntable-way">
      {SHOWN.map((share) => <Picture key={share} sessionId={sessionId} camera={turned(camera, turns * share)} degrees={turns * share * 360} {...size} />)}
    </div>
  );
}

function Picture({ sessionId, camera, degrees, width, height }: { sessionId: string; camera: Camera; degrees: number; width: number; height: number }) {
  const [address, setAddress] = useState<string | null>(null);
  const patch = JSON.stringify({ camera: { orthographic_height: null, fov_y_degrees: null, ...camera } });
  useEffect(() => {
    let made: string | null = null;
    const stop = askPreview(sessionId, { patch: JSON.parse(patch) as Record<string, unknown>, width, height }, (blob, stopped) => {
      if (stopped) return;
      made = URL.createObjectURL(blob);
      setAddress(made);
    }, () => undefined); // The words beneath still say what it would be.
    return () => {
      stop();
      if (made !== null) URL.revokeObjectURL(made);
    };
  }, [sessionId, patch, width, height]);
  return (
    <figure data-drawn={address !== null} data-testid="turntable-picture">
      <span style={{ aspectRatio: `${width} / ${height}` }}>{address !== null && <img src={address} alt="" />}</span>
      <figcaption className="dim">{Math.round(degrees)}°</figcaption>
    </figure>
  );
}

/** The settings once they have been left alone for a moment. */
function useSettled(settings: TurntableSettings): TurntableSettings {
  const [settled, setSettled] = useState(settings);
  useEffect(() => {
    const timer = window.setTimeout(() => setSettled(settings), TYPING_MILLIS);
    return () => window.clearTimeout(timer);
  }, [settings]);
  return settled;
}

/** The export: how far it has come, or its file. */
function Job() {
  const job = useTurntable((state) => state.job);
  if (!job) return null;
  const underWay = isUnderWay(job);
  return (
    <div data-testid="turntable-job" data-state={job.state} data-done={job.frames_done}>
      <Progress value={(job.frames_done / job.frames) * 100} size={4} aria-label="Pictures drawn" />
      <div className="turntable-foot">
        <span role="status" className="number">{underWay ? progressInWords(job) : `${job.frames} pictures, ${formatBytes(job.bytes)}`}</span>
        {underWay ? (
          <Button variant="default" onClick={() => void dropTurntable()} data-testid="turntable-cancel">Cancel</Button>
        ) : (
          <span className="tile-buttons">
            <Button variant="default" onClick={() => void dropTurntable()} data-testid="turntable-another">Another one</Button>
            <Button component="a" href={exportFileUrl(job.id)} download={`${baseName()}-turntable.${job.format === "zip" ? "zip" : "png"}`} data-testid="turntable-download">Download</Button>
          </span>
        )}
      </div>
      {!underWay && job.format === "apng" && <img className="turntable-result" src={exportFileUrl(job.id)} alt="The turntable" />}
    </div>
  );
}
