// Shapes of what reports hold and what the service answers. SI units without suffix, as everywhere in catseye:
// m, rad, s; MJD for instants; other units are in the name. null is an unknown number.

export type Num = number | null;
export type Word = "good" | "doubtful" | "failed";
export interface Verdict { word: Word; why: string }

// A report, or any result to explore ---------------------------------------------------------------------------------
export interface Report {
  format: "catseye-report-1";
  title: string;
  subtitle: string;
  verdict: Verdict | null;
  cards: { name: string; value: string; remark: string }[];
  passages: { title: string; text: string }[];
  sections: { id: string; title: string; blocks: Block[] }[];
  tables: Record<string, Table>;
  scenes: Record<string, Scene>;
  charts: Record<string, Chart>;
  drawings: Record<string, string>; // SVG of the writers
}
export type Block =
  | { kind: "text"; text: string; faint?: boolean }
  | { kind: "heading"; text: string }
  | { kind: "list"; items: string[] }
  | { kind: "table"; table: string; caption?: string; folded?: string } // folded: title of what opens
  | { kind: "scene"; scene: string; caption: string }
  | { kind: "chart"; chart: string; caption: string }
  | { kind: "drawing"; drawing: string; caption: string };

export interface Column {
  key: string;
  label: string;
  unit: string; // "" for none
  kind: "number" | "text" | "long" | "hash";
  digits?: number; // decimals shown; the value itself is in the tool tip and in the CSV
  u?: string; // key of the column with the standard uncertainty of this one
  values: (Num | string)[];
}
export interface Table { columns: Column[]; name?: string /* key of the column that names a thing of scenes and charts */ }

export interface Scene {
  frame: string;
  points: {
    name: string[]; x: Num[]; y: Num[]; z: Num[];
    covariance?: { xx: Num[]; xy: Num[]; xz: Num[]; yy: Num[]; yz: Num[]; zz: Num[] }; // m^2
    group: number[]; // index into groups
    info?: string[]; // a line for the tool tip
  };
  groups: string[];
  beams?: { from: number[]; to: number[]; value: Num[]; name?: string[] }; // value: standardised residual w
  lines?: { name: string; x: number[]; y: number[]; z: number[] }[]; // structure: a NaN-free polyline each
  value?: { label: string; unit: string; values: Num[] }; // colour of each point, diverging about 0
}

export interface Axis { label: string; unit: string; values?: Num[]; categories?: string[] /* then values are indices */ }
export interface Chart {
  type: "scatter" | "line" | "bars" | "histogram" | "normal" | "map"; // map: x, y to scale, coloured by value
  x: Axis;
  y?: Axis; // none for histogram and normal
  u?: Num[]; // of y, 1 sigma
  value?: { label: string; unit: string; values: Num[] }; // colour
  name?: string[]; // of each mark: a point, a shot
  group?: number[]; groups?: string[];
  limits?: number[]; // dashed lines on y (on x for a histogram)
  outline?: { x: number[]; y: number[] }[];
}
