/**
 * Sizes and defaults of the components. Their colours and fonts are in mantine.css: the service
 * forbids style elements made by scripts, so nothing is left to the theme that would need one.
 */

import { createTheme, type ButtonProps, type MantineTheme } from "@mantine/core";

const compact = { defaultProps: { size: "xs" } };

export const theme = createTheme({
  focusRing: "auto",
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
      vars: (_theme: MantineTheme, { size, variant = "filled" }: ButtonProps) => ({
        root: {
          "--button-height": size === "xs" ? "26px" : "22px", "--button-padding-x": size === "xs" ? "10px" : "8px", "--button-fz": "var(--text-body)",
          ...(variant === "filled" ? { "--button-color": "var(--on-accent)" } : {}),
        },
      }),
    },
    ActionIcon: { defaultProps: { size: 26, variant: "subtle" } },
    Tooltip: { defaultProps: { openDelay: 450, withArrow: false, multiline: true, maw: 280, fz: "var(--text-body)" } },
    // Its stand-in for the first item is no item, which readers of screens stumble over.
    Menu: { defaultProps: { withInitialFocusPlaceholder: false } },
    Popover: { defaultProps: { shadow: "md" } },
    // The page has one banner: its own.
    Modal: { defaultProps: { attributes: { header: { role: "presentation" } }, centered: true, overlayProps: { backgroundOpacity: 0.45 }, transitionProps: { duration: 80 }, lockScroll: false } },
  },
});
