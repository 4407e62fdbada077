/** What the last frame did and did not do, and what it cost. */

import { IconButton } from "../app/controls";
import { useUi } from "../app/uiStore";
import { formatBytes } from "../datasets/format";
import type { FrameHeader, FrameReport } from "../generated/proto";
import { samplesAtRest } from "../quality/methods";
import { pictureState, useSession } from "../session/store";
import { editRows, formatCount, headline, passesRun, stageTime, stateInWords, words } from "./figures";

export function StatisticsPanel() {
  const report = useSession((state) => state.report);
  const change = useSession((state) => state.changeReport);
  const picture = useSession((state) => state.pictureReport);
  const frame = useSession((session) => session.frame);
  const samples = useSession((session) => (session.scene ? samplesAtRest(session.scene) : 1));
  const edit = useSession((session) => session.editWork);
  const state = stateInWords(useSession(pictureState), frame, samples);
  return (
    <aside className="statistics" data-testid="statistics">
      <header>
        <h2>Statistics</h2>
        <span className="dim" data-testid="statistics-headline">{headline(change, report)}</span>
        <IconButton icon="close" label="Close" hotkey="I" testId="statistics-close" onClick={() => useUi.setState({ statisticsOpen: false })} />
      </header>
      <div className="statistics-columns">
        <section>
          {edit && <>
            <h3>What became of the last edit</h3>
            <Table rows={editRows(edit)} testId="edit-work" />
          </>}
          <h3>{change ? "What the last change made run" : "What ran for this picture"}</h3>
          {report ? <Plan report={change ?? report} /> : <p className="hint">The first report comes with the next picture.</p>}
        </section>
        <section>
          <h3>Newest picture: {state}</h3>
          {report && change && report !== change && <SinceThen report={report} />}
          {picture && <Stages report={picture} />}
          {frame && <FrameFigures frame={frame} />}
        </section>
        <section>
          <h3>Its work</h3>
          {picture && <Table rows={Object.entries(picture.counters).map(([name, count]) => [words(name), formatCount(count)])} testId="counters" />}
        </section>
        <section>
          <h3>Memory and device</h3>
          {picture && <Table rows={Object.entries(picture.gpu_bytes).map(([name, bytes]) => [words(name), formatBytes(bytes)])} testId="memory" />}
          <Device />
        </section>
      </div>
    </aside>
  );
}

function Plan({ report }: { report: FrameReport }) {
  return (
    <table className="plan" data-testid="plan">
      <tbody>
        {report.plan.map((pass) => (
          <tr key={pass.pass} data-runs={pass.runs} data-testid={`plan-${pass.pass}`}>
            <td>{words(pass.pass)}</td>
            <td className="plan-state">{pass.runs ? "run" : "skip"}</td>
            <td className="number plan-work">{pass.runs ? `${formatCount(pass.work)} ${pass.unit}` : ""}</td>
            <td className="plan-reason">{pass.reason}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

/** Why the newest picture was made, where it is not the one that first showed the change. */
function SinceThen({ report }: { report: FrameReport }) {
  const done = passesRun(report);
  if (done.length === 0) return <p className="hint" data-testid="since-then">Nothing had to run: the film was complete.</p>;
  return <ul className="since-then" data-testid="since-then">{done.map((line) => <li key={line}>{line}</li>)}</ul>;
}

/** Stage times as a strip: widths are shares of the sum. */
function Stages({ report }: { report: FrameReport }) {
  const total = report.stages.reduce((sum, stage) => sum + stage.millis, 0);
  return (
    <>
      <div className="stage-strip" data-testid="stages">
        {report.stages.map((stage, index) => (
          <span key={`${stage.stage}-${index}`} style={{ flexGrow: Math.max(stage.millis, total * 0.004) }} data-shade={index % 4} title={`${words(stage.stage)}: ${stageTime(stage)}`} />
        ))}
      </div>
      <dl className="facts">
        {report.stages.map((stage, index) => (
          <div key={`${stage.stage}-${index}`}>
            <dt><i className="stage-key" data-shade={index % 4} />{words(stage.stage)}</dt>
            <dd title={stage.device_millis === undefined ? undefined : "By the wall, and by the device's own clock"}>{stageTime(stage)}</dd>
          </div>
        ))}
      </dl>
    </>
  );
}

function FrameFigures({ frame }: { frame: FrameHeader }) {
  const millis = (micros: number) => `${(micros / 1000).toFixed(1)} ms`;
  return (
    <Table
      testId="frame-figures"
      rows={[
        ["waited", millis(frame.queue_micros)],
        ["rendered", millis(frame.render_micros)],
        ["encoded", millis(frame.encode_micros)],
        ["frame", `${frame.frame}, epoch ${frame.snapshot_epoch}`],
        ["lighting", `epoch ${frame.illumination_epoch}, ${Math.round(frame.illumination_completeness * 100)} % up to date`],
        ["picture", `${frame.width} × ${frame.height}, ${frame.quality === 0 ? "lossless" : `JPEG ${frame.quality}`}, ${formatBytes(frame.payload_bytes)}`],
        ["samples per pixel", String(frame.samples_per_pixel)],
      ]}
    />
  );
}

function Device() {
  const device = useSession((state) => state.device ?? state.status?.device ?? null);
  const version = useSession((state) => state.status?.version);
  if (!device) return null;
  return (
    <>
      <Table testId="device" rows={[["device", device.name], ["driver", device.driver], ...(version === undefined ? [] : [["service", version] as [string, string]])]} />
      {device.software && <p className="note" data-testid="software-notice">This is a software device: the service found no GPU. Pictures are smaller while you move, and refining takes longer.</p>}
    </>
  );
}

function Table({ rows, testId }: { rows: [string, string][]; testId: string }) {
  return (
    <dl className="facts" data-testid={testId}>
      {rows.map(([name, value]) => (
        <div key={name}>
          <dt>{name}</dt>
          <dd>{value}</dd>
        </div>
      ))}
    </dl>
  );
}
