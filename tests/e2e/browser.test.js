/** The page in a real browser on a real service, judged by its pixels. */

import { after, before, describe } from "node:test";
import { startBrowser } from "./lib/browser.js";
import { Server } from "./lib/server.js";
import { world } from "./lib/world.js";
import { accessibilitySteps } from "./steps/accessibility.js";
import { cameraSteps } from "./steps/camera.js";
import { curveSteps } from "./steps/curve.js";
import { environmentSteps } from "./steps/environments.js";
import { firstVisitSteps } from "./steps/first-visit.js";
import { gallerySteps } from "./steps/gallery.js";
import { handleSteps } from "./steps/handles.js";
import { journeySteps } from "./steps/journey.js";
import { layoutSteps } from "./steps/layout.js";
import { lightGridSteps } from "./steps/light-grid.js";
import { lightSteps } from "./steps/lights.js";
import { modeSteps } from "./steps/modes.js";
import { bakeSteps } from "./steps/bakes.js";
import { photonSteps } from "./steps/photons.js";
import { planSteps } from "./steps/plan.js";
import { restartSteps } from "./steps/restart.js";
import { returnSteps } from "./steps/return.js";
import { stillSteps } from "./steps/still.js";
import { touchSteps } from "./steps/touch.js";
import { transferSteps } from "./steps/transfer-function.js";
import { turntableSteps } from "./steps/turntable.js";
import { uploadSteps } from "./steps/uploads.js";
import { watchingSteps } from "./steps/watching.js";

describe("the page in a real browser", () => {
  before(async () => {
    world.server = await Server.start();
    world.browser = await startBrowser();
  });
  after(async () => {
    await world.browser?.close();
    await world.server?.end();
  });

  firstVisitSteps();
  uploadSteps();
  cameraSteps();
  transferSteps();
  curveSteps();
  lightSteps();
  lightGridSteps();
  photonSteps();
  bakeSteps();
  environmentSteps();
  handleSteps();
  touchSteps();
  modeSteps();
  planSteps();
  returnSteps();
  stillSteps();
  turntableSteps();
  gallerySteps();
  watchingSteps();
  restartSteps();
  journeySteps();
  layoutSteps();
  accessibilitySteps();
});
