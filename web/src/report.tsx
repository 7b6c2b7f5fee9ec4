// The script of self-contained reports: slices, wall and polar map are drawn and linked by the page's own code. A
// report is whole without it; what it draws stands where a picture would.

import { type ComponentChildren, render } from "preact";
import "./report.css";
import { LUTS, UPTAKE } from "./viewer/colours";
import { type Mesh, withNormals } from "./viewer/mesh";
import { Pictures } from "./viewer/pictures";
import type { PolarMap } from "./generated/openapi";
import { WallFrame, middleOfSegment, segmentAt } from "./viewer/polar";
import { PolarView } from "./viewer/polarview";
import { Scene } from "./viewer/scene";
import { type Placed, type Shown, byVertex, heartOf, middleOf, wallNames } from "./viewer/shown";
import type { Vec } from "./viewer/vector";
import { Voxels, unpackNifti } from "./viewer/volume";
import { Wall } from "./viewer/wall";

interface EmbeddedMesh {
  /** Three numbers for each vertex, mm, and for each triangle. */
  vertices: number[];
  triangles: number[];
  uncertainty_mm: number[];
}

/** What a report embeds. */
interface Embedded {
  name: string;
  mesh: EmbeddedMesh;
  /** The wall by the other edge. */
  other: EmbeddedMesh | null;
  /** Of a fit, what its report says of its place, and which wall it shows. */
  fit: (Placed & { edge: string }) | null;
  polar: PolarMap | null;
  /** Of a model, its distances to the surface. */
  distance: { parts: number; distances_mm: number[] } | null;
  /** The scan about the heart: a packed NIfTI file, in base64. */
  region: string | null;
}

function triples<T>(flat: number[]): T[] {
  return Array.from({ length: flat.length / 3 }, (_, n) => [flat[3 * n], flat[3 * n + 1], flat[3 * n + 2]] as T);
}

function meshOf({ vertices, triangles, uncertainty_mm }: EmbeddedMesh): Mesh {
  return { ...withNormals(triples<Vec>(vertices), triples<Mesh["triangles"][number]>(triangles)), uncertainty_mm };
}

function shownOf({ mesh: own, other, fit, polar, distance }: Embedded): Shown {
  const mesh = meshOf(own);
  const heart = fit && heartOf(fit);
  return {
    mesh,
    otherEdge: other && meshOf(other),
    names: wallNames(fit?.edge, other !== null, fit !== null),
    polar,
    heart,
    middle: middleOf(mesh, heart),
    mask: null,
    expert: null,
    displacement: null,
    surface: distance ? byVertex(mesh, distance) : null,
    gates: null,
    figures: [],
  };
}

/** Without a scan, a voxel that shows nothing. */
function voxelsOf(region: string | null): Promise<Voxels> {
  if (region) return unpackNifti(Uint8Array.from(atob(region), letter => letter.charCodeAt(0)).buffer);
  return Promise.resolve(
    new Voxels(
      [1, 1, 1],
      [
        [1, 0, 0, 0],
        [0, 1, 0, 0],
        [0, 0, 1, 0],
      ],
      new Float32Array(1),
    ),
  );
}

/** Draws `view` in the place that the report keeps for it; pictures of the same are for paper then. */
function put(place: string, view: ComponentChildren): void {
  const host = document.getElementById(place);
  if (!host) return;
  render(view, host);
  host.hidden = false;
  host.closest("section")?.classList.add("touched");
}

/**
 * The rows of the segments: a press of the number takes the cursor there, and the row of the cursor's segment is
 * marked.
 */
function linkSegments(scene: Scene, frame: WallFrame, map: PolarMap): void {
  const rows = new Map(
    [...document.querySelectorAll<HTMLTableRowElement>("tr[data-segment]")].map(row => [
      Number(row.dataset["segment"]),
      row,
    ]),
  );
  for (const [number, row] of rows) {
    const cell = row.cells[0];
    if (!cell) continue;
    const button = document.createElement("button");
    button.type = "button";
    button.className = "plain";
    button.textContent = String(number);
    button.ariaLabel = `Segment ${number}: show its middle`;
    button.addEventListener("click", () => (scene.cursor.value = frame.at(...middleOfSegment(map, number))));
    cell.replaceChildren(button);
  }
  const mark = () => {
    const [along, around] = frame.place(scene.cursor.value);
    const here = along >= 0 && along <= map.rows + 1 ? segmentAt(map, along, around)?.number : undefined;
    for (const [number, row] of rows) {
      if (number === here) row.setAttribute("aria-current", "true");
      else row.removeAttribute("aria-current");
    }
  };
  scene.cursor.watch(mark);
  mark();
}

async function draw(embedded: Embedded): Promise<void> {
  const shown = shownOf(embedded);
  const scene = new Scene(await voxelsOf(embedded.region), LUTS["Hot iron"]!, LUTS[UPTAKE]!);
  const { mesh, heart, polar } = shown;
  scene.heart.value = heart;
  scene.cursor.value = shown.middle;
  if (embedded.region)
    put("viewer", <Pictures scene={scene} name={embedded.name} shown={shown} other={null} empty="" />);
  else {
    put(
      "viewer",
      <div class="pictures alone">
        <div class="grid one">
          <Wall
            scene={scene}
            mesh={mesh}
            inner={shown.otherEdge}
            other={null}
            polar={polar}
            displacement={null}
            surface={shown.surface}
            gates={null}
            figures={[]}
          />
        </div>
      </div>,
    );
  }
  if (polar && heart) {
    put("polar", <PolarView scene={scene} map={polar} mesh={mesh} heart={heart} title="Polar map" />);
    linkSegments(scene, new WallFrame(mesh, heart, polar.rows, polar.columns), polar);
  }
}

const data = document.getElementById("data");
if (data) void draw(JSON.parse(data.textContent ?? "") as Embedded);
