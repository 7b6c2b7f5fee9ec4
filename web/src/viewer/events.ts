type Events = HTMLElementEventMap & { webglcontextlost: Event };
type Handlers = { [Name in keyof Events]?: (event: Events[Name]) => void };

/**
 * Calls the handlers on the events of an element; the answer stops that. Every event can be prevented, the wheel's too.
 */
export function handleEvents(element: HTMLElement, handlers: Handlers): () => void {
  const all = Object.entries(handlers) as [string, EventListener][];
  for (const [name, handler] of all) element.addEventListener(name, handler, { passive: false });
  return () => {
    for (const [name, handler] of all) element.removeEventListener(name, handler);
  };
}
