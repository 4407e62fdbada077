/** The product's promise on one line: state, error, latency, bandwidth, what was saved. */

import { useUi } from "../app/uiStore";
import { pictureState, useSession } from "../session/store";
import { skippedShare, stateInWords } from "./figures";

export function StatusLine() {
  const state = useSession(pictureState);
  const frame = useSession((session) => session.frame);
  const samples = useSession((session) => session.scene?.sampling.samples_per_pixel ?? 1);
  const skipped = useSession((session) => skippedShare(session.report));
  const software = useSession((session) => session.device?.software ?? session.status?.device.software ?? false);
  const { latencyMillis, framesPerSecond, megabitsPerSecond } = useSession((session) => session.readings);
  const error = frame && Number.isFinite(frame.error_estimate) ? frame.error_estimate : null;
  return (
    <button type="button" className="status-line" title="Statistics" data-testid="status-line" onClick={() => useUi.setState((ui) => ({ statisticsOpen: !ui.statisticsOpen }))}>
      <span className="status-state" data-testid="status-state" data-state={state}><i data-state={state} />{stateInWords(state, frame, samples)}</span>
      {software && <span className="status-software" data-testid="status-software" title="No GPU: a software device draws, at reduced resolution while moving">software device</span>}
      <span className="status-gap" />
      <Figure label="error" value={error === null ? "–" : `${(error * 100).toFixed(1)} %`} width={88} testId="status-error" />
      <Figure label="input to picture" value={latencyMillis === null ? "–" : `${Math.round(latencyMillis)} ms`} width={150} testId="status-latency" />
      <Figure label="fps" value={framesPerSecond.toFixed(0)} width={46} testId="status-fps" />
      <Figure label="Mbit/s" value={megabitsPerSecond.toFixed(1)} width={78} testId="status-bandwidth" />
      <Figure label="samples skipped" value={skipped === null ? "–" : `${Math.round(skipped * 100)} %`} width={138} testId="status-skipped" />
      <Figure label="" value={frame ? `${frame.width} × ${frame.height}` : "–"} width={84} testId="status-resolution" />
    </button>
  );
}

function Figure({ label, value, width, testId }: { label: string; value: string; width: number; testId: string }) {
  return (
    <span className="figure" style={{ width }} data-testid={testId}>
      <b>{value}</b>
      {label !== "" && <span>{label}</span>}
    </span>
  );
}
