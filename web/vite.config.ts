import react from "@vitejs/plugin-react";
import { defineConfig } from "vitest/config";

// `npm run dev` serves the page and hands everything under /api to a running service.
const service = "127.0.0.1:8080";

export default defineConfig({
  plugins: [react()],
  build: { target: "es2022", sourcemap: false, chunkSizeWarningLimit: 900 },
  // The colours are tested as they are written.
  test: { css: { include: [/tokens\.css/] }, setupFiles: ["./vitest.setup.js"] },
  server: {
    proxy: {
      "/api": { target: `http://${service}`, ws: true },
    },
  },
});
