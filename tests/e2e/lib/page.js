/** The page as a person uses it, and what it shows. */

import { until } from "./wait.js";

/** Longest wait for a picture at rest, milliseconds; software devices are slow. */
export const FINAL_MILLIS = 60_000;
/** Longest wait for anything that needs no drawing, milliseconds. */
export const SHORT_MILLIS = 20_000;

/** Size of the page, CSS pixels: the smallest with both panels beside the picture. */
const WIDTH = 900;
const HEIGHT = 420;

/** Moves of the mouse in one drag. Few, so that only the last one goes beyond the end of a range. */
const DRAG_STEPS = 3;

/** One visitor: a fresh browser context with one page. */
export class Visitor {
  /** Console errors, page errors and content policy violations. */
  complaints = [];
  /** Number of the newest input the page has sent. */
  sent = 0;
  /** Pictures received. */
  frames = 0;
  /** The input that each picture shows, and what waiting, drawing and encoding took, by its number; of the frame header (`proto/src/frame.rs`). */
  headers = new Map();
  /** Reports received: what was done for each picture. */
  reports = [];

  static async arrive(browser, origin, { hash = "", width = WIDTH, height = HEIGHT, colorScheme = "dark", hasTouch = false } = {}) {
    const context = await browser.newContext({ viewport: { width, height }, acceptDownloads: true, colorScheme, hasTouch });
    const visitor = new Visitor(context, await context.newPage(), origin);
    await visitor.page.goto(`${origin}/${hash}`);
    return visitor;
  }

  constructor(context, page, origin) {
    this.context = context;
    this.page = page;
    this.origin = origin;
    page.setDefaultTimeout(SHORT_MILLIS);
    page.on("console", (message) => message.type() === "error" && this.complaints.push(message.text()));
    page.on("pageerror", (error) => this.complaints.push(String(error)));
    page.on("websocket", (socket) => {
      // The page counts from 1 again after it was loaded anew.
      socket.on("framesent", ({ payload }) => {
        const { type, seq } = JSON.parse(String(payload));
        if (type === "hello") this.sent = 0;
        if (seq !== undefined) this.sent = seq;
      });
      socket.on("framereceived", ({ payload }) => {
        if (typeof payload !== "string") {
          this.frames += 1;
          this.headers.set(payload.readUInt32LE(8), {
            seq: payload.readUInt32LE(12), queue_micros: payload.readUInt32LE(48), render_micros: payload.readUInt32LE(52), encode_micros: payload.readUInt32LE(56),
          });
          return;
        }
        const { type, report } = JSON.parse(payload);
        if (type === "report") this.reports.push(report);
      });
    });
  }

  leave() {
    return this.context.close();
  }

  /** The element with this `data-testid`. */
  at(id) {
    return this.page.getByTestId(id);
  }

  /** A `data-` attribute of the element with this test id. */
  data(id, name) {
    return this.at(id).getAttribute(`data-${name}`);
  }

  /** Everything done so far has left for the service. */
  async flushed() {
    await this.page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  }

  /** The pixels of the canvas, with what the page says of them. */
  look() {
    return this.page.evaluate(() => {
      const canvas = document.querySelector("[data-testid=viewport]");
      const { width, height, dataset } = canvas;
      const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
      let text = "";
      for (let at = 0; at < data.length; at += 0x8000) text += String.fromCharCode(...data.subarray(at, at + 0x8000));
      return { width, height, text: btoa(text), state: dataset.state, frame: Number(dataset.frame ?? -1), seq: Number(dataset.seq ?? -1), size: dataset.size };
    }).then(({ text, ...rest }) => ({ ...rest, data: Buffer.from(text, "base64") }));
  }

  /** The finished picture of everything done so far; the last thing done must be one that can be seen. */
  async picture() {
    await this.flushed();
    await until(`a final picture of input ${this.sent}`, FINAL_MILLIS, async () => {
      const { state, seq } = await this.at("viewport").evaluate(({ dataset }) => ({ ...dataset }));
      return state === "final" && Number(seq) >= this.sent;
    });
    return this.look();
  }

  /** Drags from one place of an element to another; places in its widths and heights. */
  async drag(id, from, to) {
    await this.at(id).scrollIntoViewIfNeeded();
    const box = await this.at(id).boundingBox();
    const place = ([x, y]) => [box.x + x * box.width, box.y + y * box.height];
    await this.#dragBetween(place(from), place(to));
  }

  /** Drags a point or band of the transfer function down to opacity 0. */
  async dragToZero(id) {
    await this.at(id).scrollIntoViewIfNeeded();
    const { x, y, width, height } = await this.at(id).boundingBox();
    const { height: plot } = await this.at("tf-editor").boundingBox();
    const [column, row] = [x + width / 2, y + height / 2];
    await this.#dragBetween([column, row], [column, row + plot]);
  }

  async #dragBetween(from, to) {
    await this.page.mouse.move(...from);
    await this.page.mouse.down();
    await this.page.mouse.move(...to, { steps: DRAG_STEPS });
    await this.page.mouse.up();
  }

  /** Fingers that go down together, move in a straight line each, and leave. Places in the element's widths and heights. */
  async fingers(id, ways) {
    await this.at(id).scrollIntoViewIfNeeded();
    const box = await this.at(id).boundingBox();
    const cdp = await this.context.newCDPSession(this.page);
    const at = (share) => ways.map(([[x0, y0], [x1, y1]], finger) => ({
      x: box.x + (x0 + share * (x1 - x0)) * box.width, y: box.y + (y0 + share * (y1 - y0)) * box.height, id: finger,
    }));
    await cdp.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: at(0) });
    for (let step = 1; step <= DRAG_STEPS; step += 1) await cdp.send("Input.dispatchTouchEvent", { type: "touchMove", touchPoints: at(step / DRAG_STEPS) });
    await cdp.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
    await cdp.detach();
  }

  async key(key) {
    await this.page.keyboard.press(key);
  }

  /** Does something that opens another session, and waits until the page has it. */
  async opening(act) {
    const before = this.session();
    await act();
    await until("another session", FINAL_MILLIS, () => this.session() !== before);
  }

  /** Identifier of the session in the address bar. */
  session() {
    return new URLSearchParams(new URL(this.page.url()).hash.slice(1)).get("session");
  }
}
