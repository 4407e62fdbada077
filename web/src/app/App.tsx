/** The page: bars, panels and the picture between them. */

import { useEffect } from "react";
import { DatasetsPanel } from "../datasets/DatasetsPanel";
import { DropZone } from "../datasets/DropZone";
import { refreshDatasets } from "../datasets/store";
import { Gallery } from "../gallery/Gallery";
import { refreshEnvironments } from "../lights/environmentStore";
import { LightsPanel } from "../lights/LightsPanel";
import { MaterialsPanel } from "../materials/MaterialsPanel";
import { ClipPanel } from "../quality/ClipPanel";
import { QualityPanel } from "../quality/QualityPanel";
import { RenderingPanel } from "../quality/RenderingPanel";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { StatisticsPanel } from "../statistics/StatisticsPanel";
import { StatusLine } from "../statistics/StatusLine";
import { TurntableDialog } from "../turntable/TurntableDialog";
import { TransferPanel } from "../transfer-function/TransferPanel";
import { Viewport } from "../viewport/Viewport";
import { HelpSheet } from "./HelpSheet";
import { handleKey } from "./keyboard";
import { sayError } from "./say";
import { TopBar } from "./TopBar";
import { isOpen, useUi } from "./uiStore";
import { WatchBar } from "./WatchBar";

/** Members of the scene whose refused edits are shown in a panel; all others become a message. */
const SHOWN_IN_PLACE = /^(transfer_function|value_range|density|materials|lights|clip|sampling|film|background|volume|scattering|illumination|rendering)/;

export function App() {
  const left = useUi((ui) => isOpen(ui, "left"));
  const right = useUi((ui) => isOpen(ui, "right"));
  const statistics = useUi((ui) => ui.statisticsOpen);
  const connected = useSession((state) => state.link === "open");

  useEffect(() => {
    window.addEventListener("keydown", handleKey);
    return () => window.removeEventListener("keydown", handleKey);
  }, []);

  // The lists are asked for at the start and after every time the service was away.
  useEffect(() => {
    void refreshDatasets();
    if (connected) void refreshEnvironments();
  }, [connected]);

  useEffect(() => useSession.subscribe(({ fieldError }, before) => {
    if (fieldError && fieldError !== before.fieldError && !SHOWN_IN_PLACE.test(fieldError.field)) {
      sayError(new Error([fieldError.field, fieldError.message].filter((part) => part !== "").join(": ")));
    }
  }), []);

  // What was selected belongs to the scene before.
  const sessionId = useSession((state) => state.sessionId);
  useEffect(() => void useUi.setState({ selectedPoints: [], selectedLight: null }), [sessionId]);

  return (
    <div className="page" data-left={left} data-right={right}>
      <TopBar />
      <WatchBar />
      {left && <aside className="panel panel-left" aria-label="Datasets" data-testid="panel-left"><DatasetsPanel /></aside>}
      <main className="stage" data-statistics={statistics}>
        <Viewport />
        {statistics && <StatisticsPanel />}
      </main>
      {right && (
        <aside className="panel panel-right" aria-label="Scene" data-testid="panel-right">
          <RenderingPanel />
          <TransferPanel />
          <MaterialsPanel />
          <LightsPanel />
          <ClipPanel />
          <QualityPanel />
        </aside>
      )}
      <StatusLine />
      <HelpSheet />
      <Gallery />
      <TurntableDialog />
      <DropZone />
    </div>
  );
}

/** Starts the session once, outside of any component's life. */
export function start(): void {
  session.start();
}
