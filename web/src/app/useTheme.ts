/** Dark or light: the system's choice, unless the person has chosen the other one. */

import { useComputedColorScheme, useMantineColorScheme } from "@mantine/core";
import { useColorScheme } from "@mantine/hooks";

export function useTheme(): { dark: boolean; toggle: () => void } {
  const { setColorScheme } = useMantineColorScheme({ keepTransitions: true });
  const system = useColorScheme("dark", { getInitialValueInEffect: false });
  const shown = useComputedColorScheme("dark", { getInitialValueInEffect: false });
  const other = shown === "dark" ? "light" : "dark";
  // Back at the system's own theme, the page follows the system again.
  return { dark: shown === "dark", toggle: () => setColorScheme(other === system ? "auto" : other) };
}
