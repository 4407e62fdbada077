/** Turntable or film: what is drawn and how, pictures of the way ahead of time, and the export under way. */

import { Button, Modal, NativeSelect, Progress, SegmentedControl } from "@mantine/core";
import { useEffect, useState } from "react";
import { exportFileUrl } from "../api/rest";
import { NumberField, Row } from "../app/controls";
import { baseName } from "../app/files";
import { useUi } from "../app/uiStore";
import { formatBytes } from "../datasets/format";
import type { Camera, ExportFormat, ExportRequest, SceneFile } from "../generated/proto";
import { samplesAtRest } from "../quality/methods";
import { useSession } from "../session/store";
import { filmInWords, filmRefusal, filmRequest } from "./film";
import { FilmViews } from "./FilmViews";
import { useSavedViews } from "./savedViews";
import { beginTurntable, dropTurntable, useTurntable } from "./store";
import { inWords, isUnderWay, LIMITS, progressInWords, refusal, requestOf, suggested, turned, type TurntableSettings } from "./turntable";
import { pictureSize, WayPicture } from "./WayPicture";

/** Shares of the way that pictures are shown of. */
const SHOWN = [0, 0.25, 0.5, 0.75] as const;
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
    <Modal opened={opened} onClose={close} title="Turntable or film" size={620} closeButtonProps={{ "aria-label": "Close" }} data-testid="turntable">
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
  return suggested({ width: frame.viewport_width, height: frame.viewport_height }, samplesAtRest(scene));
}

/** The same for a turntable and a film. */
interface Wish {
  refused: string | null;
  words: string;
  request: () => ExportRequest;
}

function Settings({ settings, change, sessionId, camera }: {
  settings: TurntableSettings;
  change: (part: Partial<TurntableSettings>) => void;
  sessionId: string;
  camera: Camera;
}) {
  const film = useUi((ui) => ui.filmChosen);
  const views = useSavedViews(sessionId);
  const { refused, words, request }: Wish = film
    ? { refused: filmRefusal(views, settings), words: filmInWords(views, settings), request: () => filmRequest(views, settings) }
    : { refused: refusal(settings), words: inWords(settings), request: () => requestOf(settings, camera) };
  const begin = () => void beginTurntable(sessionId, request());
  return (
    <>
      <SegmentedControl fullWidth value={film ? "film" : "turntable"} data={[{ value: "turntable", label: "Around the pivot" }, { value: "film", label: "Through saved views" }]} onChange={(value) => useUi.setState({ filmChosen: value === "film" })} data-testid="turntable-kind" />
      <p className="hint turntable-hint">
        {film
          ? "The camera comes through these views without a jolt and rests at the first and the last. Add the view on screen here, or with V while you look around."
          : "The camera goes around the pivot, from the view on screen, about its upright axis."}
        {" The service draws the pictures behind everything else it does; the dialog may be closed meanwhile."}
      </p>
      {film ? <FilmViews views={views} sessionId={sessionId} shape={settings} goTo={close} /> : <Way settings={settings} sessionId={sessionId} camera={camera} />}
      <div className="turntable-fields">
        {!film && <>
        <Row label="Turns" hint="Negative: the other way"><NumberField label="Turns" value={settings.turns} min={-LIMITS.turns} max={LIMITS.turns} step={0.5} testId="turntable-turns" onChange={(turns) => change({ turns })} /></Row>
        <Row label="Length"><NumberField label="Length in seconds" value={settings.seconds} min={0} max={LIMITS.frames.max} step={1} suffix=" s" testId="turntable-seconds" onChange={(seconds) => change({ seconds })} /></Row>
        </>}
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
        <span className={refused === null ? "dim" : "note-danger"} role="status" data-testid="turntable-words">{refused ?? words}</span>
        <Button onClick={begin} disabled={refused !== null} data-testid="turntable-begin">Draw</Button>
      </div>
    </>
  );
}

/** Small pictures of the way, drawn by the service. */
function Way({ settings, sessionId, camera }: { settings: TurntableSettings; sessionId: string; camera: Camera }) {
  const { width, height, turns } = useSettled(settings);
  const size = pictureSize({ width, height });
  return (
    <div className="turntable-way">
      {SHOWN.map((share) => (
        <WayPicture key={share} sessionId={sessionId} camera={turned(camera, turns * share)} {...size}>
          <figcaption className="dim">{Math.round(turns * share * 360)}°</figcaption>
        </WayPicture>
      ))}
    </div>
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
  const film = useTurntable((state) => state.film);
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
            <Button component="a" href={exportFileUrl(job.id)} download={`${baseName()}-${film ? "film" : "turntable"}.${job.format === "zip" ? "zip" : "png"}`} data-testid="turntable-download">Download</Button>
          </span>
        )}
      </div>
      {!underWay && job.format === "apng" && <img className="turntable-result" src={exportFileUrl(job.id)} alt={film ? "The film" : "The turntable"} />}
    </div>
  );
}
