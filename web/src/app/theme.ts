/** Mantine's variables, all taken from tokens.css. */

import { createTheme, type ButtonProps, type CSSVariablesResolver, type MantineTheme } from "@mantine/core";

const compact = { defaultProps: { size: "xs" } };

export const theme = createTheme({
  fontFamily: "var(--font)",
  fontFamilyMonospace: "var(--font-mono)",
  fontSizes: { xs: "12px", sm: "12px", md: "13px", lg: "13px", xl: "14px" },
  defaultRadius: "4px",
  focusRing: "auto",
  cursorType: "pointer",
  components: {
    Input: {
      ...compact,
      vars: () => ({ wrapper: { "--input-height": "26px", "--input-fz": "var(--text-body)", "--input-padding": "8px" } }),
    },
    NumberInput: compact,
    NativeSelect: compact,
    Select: compact,
    TextInput: compact,
    Switch: compact,
    SegmentedControl: compact,
    Slider: { defaultProps: { size: 3, thumbSize: 12 } },
    RangeSlider: { defaultProps: { size: 3, thumbSize: 12 } },
    Button: {
      ...compact,
      vars: (_theme: MantineTheme, { size }: ButtonProps) => ({
        root: { "--button-height": size === "xs" ? "26px" : "22px", "--button-padding-x": size === "xs" ? "10px" : "8px", "--button-fz": "var(--text-body)" },
      }),
    },
    ActionIcon: { defaultProps: { size: 26, variant: "subtle" } },
    Tooltip: { defaultProps: { openDelay: 450, withArrow: false, multiline: true, maw: 280, fz: "var(--text-body)" } },
    Popover: { defaultProps: { shadow: "md" } },
    Modal: { defaultProps: { centered: true, overlayProps: { backgroundOpacity: 0.45 }, transitionProps: { duration: 80 } } },
  },
});

const shared: Record<string, string> = {
  "--mantine-color-body": "var(--surface-panel)",
  "--mantine-color-text": "var(--text)",
  "--mantine-color-bright": "var(--text)",
  "--mantine-color-dimmed": "var(--text-dim)",
  "--mantine-color-placeholder": "var(--text-faint)",
  "--mantine-color-anchor": "var(--accent)",
  "--mantine-color-error": "var(--danger)",
  "--mantine-color-default": "var(--surface-field)",
  "--mantine-color-default-hover": "var(--surface-hover)",
  "--mantine-color-default-color": "var(--text)",
  "--mantine-color-default-border": "var(--line-strong)",
  "--mantine-color-disabled": "var(--surface-hover)",
  "--mantine-color-disabled-color": "var(--text-faint)",
  "--mantine-primary-color-filled": "var(--accent)",
  "--mantine-primary-color-filled-hover": "var(--accent-strong)",
  "--mantine-primary-color-contrast": "var(--on-accent)",
  "--mantine-primary-color-light": "var(--accent-faint)",
  "--mantine-primary-color-light-hover": "var(--accent-faint)",
  "--mantine-primary-color-light-color": "var(--accent)",
  "--mantine-color-blue-filled": "var(--accent)",
  "--mantine-color-blue-filled-hover": "var(--accent-strong)",
  "--mantine-color-gray-light-hover": "var(--surface-hover)",
  "--mantine-color-gray-light-color": "var(--text)",
  "--mantine-color-red-light-color": "var(--danger)",
  "--mantine-color-red-light-hover": "var(--danger-faint)",
};

/** The greys Mantine uses directly, darkest last as in its dark scheme. */
const darkScale = ["text", "text-dim", "text-faint", "line-strong", "line", "surface-hover", "surface-raised", "surface-panel", "surface-field", "surface-picture"];
const dark = Object.fromEntries(darkScale.map((token, index) => [`--mantine-color-dark-${index}`, `var(--${token})`]));

export const cssVariables: CSSVariablesResolver = () => ({
  variables: {},
  dark: { ...shared, ...dark },
  light: { ...shared, "--mantine-color-white": "var(--surface-raised)", "--mantine-color-gray-2": "var(--line)", "--mantine-color-gray-4": "var(--line-strong)" },
});
