// The stages of the mark search: learn the mark with the present settings, and choose what is shown.

import { ask, type LearntMark } from "./api";
import { byId } from "./dom";
import { set, state, watch, type Stage } from "./state";

const SETTINGS_MS = 500;

/** Show the stage that is chosen; the mark is learnt again when the settings change. */
export function startStages(): void {
  const choices = [...document.querySelectorAll<HTMLInputElement>("input[name=stage]")];
  let later: ReturnType<typeof setTimeout> | undefined;
  let asked = 0;
  for (const choice of choices) {
    choice.addEventListener("change", () => {
      set({ stage: choice.value as Stage });
      if (state.learnt === null) void learn();
    });
  }
  watch((changed) => {
    if (!["clip", "changes", "rig"].some((key) => changed.has(key as never))) return;
    asked += 1; // an answer that is under way is for other settings
    set({ learnt: null, found: null });
    clearTimeout(later);
    if (state.stage !== "film") later = setTimeout(() => void learn(), SETTINGS_MS);
  });

  async function learn(): Promise<void> {
    if (state.stage === "film" || state.info === null) return;
    const now = ++asked;
    byId("learnt").textContent = "looking for the mark in frames of the whole clip …";
    try {
      const learnt = await ask<LearntMark | { none: string }>(`/api/clips/${state.clip}/mark`, "POST", { sections: state.changes });
      if (now !== asked) return;
      if ("none" in learnt) {
        byId("learnt").textContent = `${learnt.none} Measuring then follows the body or its outline.`;
        return;
      }
      byId("learnt").textContent = describe(learnt);
      set({ learnt });
    } catch (fault) {
      if (now === asked) byId("learnt").textContent = (fault as Error).message;
    }
  }
  watch((changed) => {
    if (changed.has("stage") && state.stage === "film") byId("learnt").textContent = "";
    if (changed.has("found") && state.found !== null && state.learnt !== null) {
      const others = state.found.regions.length - Number(state.found.regions[0]?.mark ?? false);
      byId("learnt").textContent = `${describe(state.learnt)}; in this frame: ${state.found.status}, ${others} other regions`;
    }
  });
}

const BY: Record<string, string> = {
  declared: "by its declared colour",
  pointed: "where you pointed",
  red: "by its red",
  moving: "by how it moves",
};

function describe({ rgb, cue, area_px2 }: LearntMark): string {
  return `mark of colour ${rgb.join(", ")} and ${Math.round(area_px2)} px², found ${BY[cue] ?? cue}`;
}
