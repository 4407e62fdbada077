/** The product's promise on one line: state, error, latency, bandwidth, what was saved. */

import { useUi } from "../app/uiStore";
import { samplesAtRest } from "../quality/methods";
import { pictureState, useSession, type PictureState } from "../session/store";
import { missingLight } from "../viewport/missingLight";
import { editTimes, keptShare, reusedShare, skippedShare, stateInWords } from "./figures";

export function StatusLine() {
  const state = useSession(pictureState);
  const frame = useSession((session) => session.frame);
  const samples = useSession((session) => (session.scene ? samplesAtRest(session.scene) : 1));
  const skipped = useSession((session) => skippedShare(session.pictureReport));
  const reused = useSession((session) => keptShare(session.editWork) ?? reusedShare(session.pictureReport));
  const edit = useSession((session) => editTimes(session.editWork));
  const light = useSession((session) => missingLight(session)?.amount ?? null);
  const software = useSession((session) => session.device?.software ?? session.status?.device.software ?? false);
  const { latencyMillis, framesPerSecond, megabitsPerSecond } = useSession((session) => session.readings);
  const open = useUi((ui) => ui.statisticsOpen);
  const error = frame && Number.isFinite(frame.error_estimate) ? frame.error_estimate : null;
  return (
    <button type="button" className="status-line" aria-expanded={open} title="Statistics: what was done for this picture (I)" data-testid="status-line" onClick={() => useUi.setState({ statisticsOpen: !open })}>
      <span className="status-state" data-testid="status-state" data-state={state} title={stateHint[state]}><i data-state={state} />{stateInWords(state, frame, samples)}</span>
      {software && <span className="status-software" data-testid="status-software" title="No GPU: a software device draws, at reduced resolution while moving">software device</span>}
      {/* Most important first: what has no room goes to a second row, which is not seen. */}
      <span className="status-figures">
        {light !== null && <Figure label="light" hint="Share of the light that is that of the scene: the rest follows" value={light} width={light.includes(",") ? 142 : 72} testId="status-light" />}
        {error !== null && <Figure label="error" hint="How far off the picture is, by its own estimate: it falls as paths are added" value={`${(error * 100).toFixed(1)} %`} width={88} testId="status-error" />}
        <Figure label="input to picture" hint="Time from what you do to the picture that shows it; median of the last inputs" value={latencyMillis === null ? "–" : `${Math.round(latencyMillis)} ms`} width={150} testId="status-latency" />
        {edit !== "–" && <Figure label="edit" hint="Time from the newest edit to its first picture, and to its final one" value={edit} width={128} testId="status-edit" />}
        <Figure label="samples skipped" hint="Share of the samples on view rays that lie in empty space and cost nothing" value={skipped === null ? "–" : `${Math.round(skipped * 100)} %`} width={138} testId="status-skipped" />
        <Figure label="reused" hint="Share of what is kept (photons, tiles, or pieces of view rays) that the last edit left as it was" value={reused === null ? "–" : `${Math.round(reused * 100)} %`} width={86} testId="status-reused" />
        <Figure label="" hint="Pixels of the picture on screen" value={frame ? `${frame.width} × ${frame.height}` : "–"} width={84} testId="status-resolution" />
        <Figure label="Mbit/s" hint="Received in the last seconds" value={megabitsPerSecond.toFixed(1)} width={78} testId="status-bandwidth" />
        <Figure label="fps" hint="Pictures per second, in the last seconds" value={framesPerSecond.toFixed(0)} width={46} testId="status-fps" />
      </span>
    </button>
  );
}

const stateHint: Record<PictureState, string> = {
  loading: "The first picture of this scene is being made",
  offline: "There is no connection to the service",
  moving: "Reduced pictures follow what you do",
  refining: "At rest: the picture gets finer by itself",
  final: "As good as asked for; the picture was sent without loss",
};

function Figure({ label, hint, value, width, testId }: { label: string; hint: string; value: string; width: number; testId: string }) {
  return (
    <span className="figure" style={{ width }} title={hint} data-testid={testId}>
      <b>{value}</b>
      {label !== "" && <span>{label}</span>}
    </span>
  );
}
