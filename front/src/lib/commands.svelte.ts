// Commands to the site: what each does, the dialog that asks, and what came of it, in the site's words.
import { ApiError, post } from "./api";
import { settings } from "./settings.svelte";
import { mjdNow } from "./time";

export type Name = "MODE" | "DROP" | "TAKE" | "STREAM" | "CLOCK" | "REFERENCE" | "MOVED";
export interface Field { key: string; label: string; from: "modes" | "rangers" | "targets" | "units" | "text"; optional?: boolean }
export interface Kind {
  name: Name; title: string; about: string; fields: Field[];
  parameters: (values: Record<string, string>) => string[];
  effect: (values: Record<string, string>) => string;
}
export interface Issued {
  id: number; line: string; who: string; mjd: number;
  outcome: "in flight" | "done" | "refused"; text: string; status: number;
}

const MODES: Record<string, string> = {
  active: "The site plans rounds and fires: lasers are lit.",
  passive: "The site fires nothing; it listens to what another client measures.",
  hold: "The site stays connected and fires nothing. Shots under way are finished.",
};
const ranger: Field = { key: "ranger", label: "Ranger", from: "rangers" };

export const kinds: Kind[] = [
  {
    name: "MODE", title: "Change the mode", about: "Active plans and fires, passive listens to another client, hold fires nothing.", fields: [{ key: "mode", label: "Mode", from: "modes" }],
    parameters: (v) => [v.mode ?? ""], effect: (v) => MODES[v.mode ?? ""] ?? "Sets the coordinator's mode.",
  },
  {
    name: "DROP", title: "Leave a ranger out", about: "It stays connected and measures no more, until it is taken again.", fields: [ranger], parameters: (v) => [v.ranger ?? ""],
    effect: (v) => `${v.ranger || "The ranger"} stays connected and measures no more, until it is taken again.`,
  },
  {
    name: "TAKE", title: "Use a ranger again", about: "It is made ready, its laser is lit, and it measures again.", fields: [ranger], parameters: (v) => [v.ranger ?? ""],
    effect: (v) => `${v.ranger || "The ranger"} is made ready, its laser is lit, and it measures again.`,
  },
  {
    name: "STREAM", title: "Stream one target", about: "A ranger measures one target again and again, or ends that.", fields: [ranger, { key: "target", label: "Target (empty: end the stream)", from: "targets", optional: true }],
    parameters: (v) => (v.target ? [v.ranger ?? "", v.target] : [v.ranger ?? ""]),
    effect: (v) => v.target ? `${v.ranger || "The ranger"} measures ${v.target} again and again, and nothing else.` : `${v.ranger || "The ranger"} ends its stream and goes back to the plan.`,
  },
  {
    name: "CLOCK", title: "Accept the machine's clock", about: "The count of UTC takes this machine's clock over; where clocks disagreed, firing goes on.", fields: [], parameters: () => ["ACCEPT"],
    effect: () => "The coordinator's count of UTC takes the machine's clock over, and firing may go on. Do this only where that clock is known to be right.",
  },
  {
    name: "REFERENCE", title: "Set the zero", about: "The last epoch becomes the zero of pose, beam offset, focus and corrections.", fields: [], parameters: () => ["NOW"],
    effect: () => "The last epoch becomes the zero of pose, beam offset, focus and corrections, from the next epoch on. The journal has it, and a replay repeats it.",
  },
  {
    name: "MOVED", title: "Record a move", about: "A move of another actuator of the telescope, such as the subreflector, is recorded beside the corrections. Nothing moves.",
    fields: [{ key: "actuator", label: "Actuator", from: "text" }, { key: "value", label: "Value after the move", from: "text" }, { key: "unit", label: "Unit", from: "units" }],
    parameters: (v) => [v.actuator ?? "", v.value ?? "", v.unit ?? "", v.who ?? ""],
    effect: (v) => `Records that ${v.actuator || "the actuator"} was moved to ${v.value || "the value"} ${v.unit ?? ""}, under your name. Nothing moves.`,
  },
];

/** Why a command failed, with what to do. */
export function reason(error: unknown): { status: number; text: string } {
  if (!(error instanceof ApiError)) return { status: 0, text: String(error) };
  const lead: Record<number, string> = {
    0: "Not known to have arrived", 401: "No valid token (see Settings)", 403: "Not allowed from here",
    409: "The site refused", 422: "Not understood", 503: "The site is not connected",
  };
  return { status: error.status, text: `${lead[error.status] ?? `Status ${error.status}`}: ${error.message}` };
}

class Commands {
  /** The command that the dialog asks about, with values filled in. */
  asked = $state.raw<{ kind: Kind; values: Record<string, string> } | null>(null);
  issued = $state<Issued[]>([]);
  flying = $derived(this.issued.filter((each) => each.outcome === "in flight").length);
  private count = 0;

  ask(name: Name, values: Record<string, string> = {}): void {
    const kind = kinds.find((each) => each.name === name);
    if (kind) this.asked = { kind, values };
  }

  async send(kind: Kind, values: Record<string, string>): Promise<Issued> {
    return this.command(kind.name, kind.parameters({ ...values, who: settings.who }));
  }

  /** Command the coordinator under the name that the settings know. */
  async command(name: string, parameters: string[]): Promise<Issued> {
    const who = settings.who;
    return this.run([name, ...parameters].join(" "), who, async () => {
      const answer = await post<{ values: unknown; lease_from?: string | null }>("/api/commands", { command: name, parameters, who });
      return said(answer.values) + (answer.lease_from ? `; the lease was taken from ${answer.lease_from}` : "");
    });
  }

  /** Run any act of a person against the service and keep what came of it. */
  async run(line: string, who: string, act: () => Promise<string>): Promise<Issued> {
    this.count += 1;
    this.issued = [{ id: this.count, line, who, mjd: mjdNow(), outcome: "in flight", text: "", status: 0 } as Issued, ...this.issued].slice(0, 100);
    const entry = this.issued[0] as Issued; // the reactive one
    try {
      entry.text = await act();
      entry.outcome = "done";
    } catch (error) {
      const { status, text } = reason(error);
      entry.status = status;
      entry.text = text;
      entry.outcome = "refused";
    }
    return entry;
  }
}

function said(values: unknown): string {
  if (Array.isArray(values)) return values.map((each) => said(each)).join(", ");
  return values == null ? "" : String(values);
}

export const commands = new Commands();
