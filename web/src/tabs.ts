// The other tabs of this browser on the same service: told when this one changed something, so that they look again.

const channel = "BroadcastChannel" in window ? new BroadcastChannel("ventriform") : null;

/** Says that something was stored, filed or erased. What it was, another tab asks the service with its own key. */
export function tellTabs(): void {
  channel?.postMessage("changed");
}

/** Calls `act` whenever another tab says so; returns what ends that. */
export function onTold(act: () => void): () => void {
  const told = () => act();
  channel?.addEventListener("message", told);
  return () => channel?.removeEventListener("message", told);
}
