// A part (scene, chart, table) in a host element: made once, updated when its data change, destroyed with the element.
import type { Attachment } from "svelte/attachments";

interface Part<Data> { update(data: Data): void; select?(name: string | null): void; destroy(): void }

export function part<Data, Options>(
  make: (host: HTMLElement, data: Data, options: Options) => Part<Data>,
  data: () => Data,
  options: Options,
  chosen: () => string | null = () => null,
): Attachment<HTMLElement> {
  return (host) => {
    let made: Part<Data> | null = null;
    $effect(() => {
      const next = data();
      if (made) made.update(next);
      else made = make(host, next, options);
    });
    $effect(() => made?.select?.(chosen()));
    return () => made?.destroy();
  };
}
