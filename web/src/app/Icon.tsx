/** Line icons on a 16 x 16 grid. */

const paths = {
  undo: "M6 3 2.5 6.5 6 10M3 6.5h6.5a4 4 0 0 1 0 8H7",
  redo: "M10 3l3.5 3.5L10 10M13 6.5H6.5a4 4 0 0 0 0 8H9",
  share: "M8 9.5V1.8M5 4.5l3-3 3 3M4 7H2.8v7h10.4V7H12",
  save: "M8 2v8M5 7.2l3 3 3-3M2.5 11v2.5h11V11",
  open: "M2 13V3.5h4l1.5 2H14V13zM2 8h12",
  upload: "M8 11V3M5 5.8l3-3 3 3M2.5 11v2.5h11V11",
  sun: "M8 5a3 3 0 1 0 0 6 3 3 0 0 0 0-6zM8 1v1.6M8 13.4V15M1 8h1.6M13.4 8H15M3 3l1.2 1.2M11.8 11.8 13 13M13 3l-1.2 1.2M4.2 11.8 3 13",
  moon: "M13.3 9.6A5.8 5.8 0 0 1 6.4 2.7a5.8 5.8 0 1 0 6.9 6.9z",
  help: "M8 14.5a6.5 6.5 0 1 0 0-13 6.5 6.5 0 0 0 0 13zM6 6.2a2 2 0 1 1 2.9 1.8c-.6.3-.9.7-.9 1.4M8 11.4v.4",
  eye: "M1.2 8S3.6 3.5 8 3.5 14.8 8 14.8 8 12.4 12.5 8 12.5 1.2 8 1.2 8zM8 6a2 2 0 1 0 0 4 2 2 0 0 0 0-4z",
  eyeOff: "M2 2l12 12M6.3 3.8A6.5 6.5 0 0 1 8 3.5C12.4 3.5 14.8 8 14.8 8a11 11 0 0 1-2 2.6M10 11.9a6 6 0 0 1-2 .6C3.6 12.5 1.2 8 1.2 8a10.700 10.7 0 0 1 2.6-3.100",
  trash: "M2.5 4.500h11M6 4.500V2.500h4v2M4 4.500l.6 9h6.800l.6-9M6.700 7v4M9.300 7v4",
  plus: "M8 2.500v11M2.500 8h11",
  close: "M3.500 3.500l9 9M12.500 3.500l-9 9",
  home: "M2 8l6-5.500L14 8M3.700 7v6.500h8.600V7M6.500 13.500V10h3v3.500",
  expand: "M2.500 6V2.500H6M10 2.500h3.500V6M13.500 10v3.500H10M6 13.500H2.500V10",
  camera: "M2 5h3l1-1.800h4L11 5h3v8H2zM8 6.600a2.200 2.200 0 1 0 0 4.400 2.200 2.200 0 0 0 0-4.400z",
  perspective: "M2.500 5.500v5l6 3.500V2zM8.500 2l5 3v6l-5 3",
  orthographic: "M2.500 5h8v8.500h-8zM2.500 5l3-2.500h8v8.500l-3 2.500M10.500 5l3-2.500",
  panelLeft: "M2 3h12v10H2zM6 3v10",
  panelRight: "M2 3h12v10H2zM10 3v10",
  chevron: "M5 6.500 8 9.500l3-3",
  more: "M3 7.500a.5.5 0 1 0 0 1 .5.5 0 0 0 0-1zM8 7.500a.5.5 0 1 0 0 1 .5.5 0 0 0 0-1zM13 7.500a.5.5 0 1 0 0 1 .5.5 0 0 0 0-1z",
  contrast: "M8 14a6 6 0 1 0 0-12 6 6 0 0 0 0 12zM8 2v12M8 5h4.600M8 8h6M8 11h4.600",
  box: "M2.500 5 8 2l5.500 3v6L8 14l-5.500-3zM2.500 5 8 8l5.500-3M8 8v6",
  grid: "M2.500 2.500h4.500v4.500H2.500zM9 2.500h4.500v4.500H9zM2.500 9h4.500v4.500H2.500zM9 9h4.500v4.500H9z",
  target: "M8 4a4 4 0 1 0 0 8 4 4 0 0 0 0-8zM8 1.500V5M8 11v3.500M1.500 8H5M11 8h3.500",
} as const;

export type IconName = keyof typeof paths;

export function Icon({ name, size = 16 }: { name: IconName; size?: number }) {
  return (
    <svg className="icon" width={size} height={size} viewBox="0 0 16 16" aria-hidden="true">
      <path d={paths[name]} />
    </svg>
  );
}
