// Measuring and closing: start, watch the progress, cancel.

import { ask, type Job } from "./api";
import { byId } from "./dom";

const EVERY_MS = 300;
const CHOICES = ["measure", "close"];

/** Watches one job at a time and shows how far it is. */
export class Jobs {
  private id: number | null = null;

  constructor(
    private readonly ended: (job: Job) => void,
    private readonly say: (text: string, isProblem?: boolean) => void,
  ) {
    byId("cancel").addEventListener("click", () => {
      if (this.id !== null) void ask(`/api/jobs/${this.id}`, "DELETE").catch((fault: Error) => this.say(fault.message, true));
    });
  }

  /** Start a job: measure a clip, or close the session. */
  async start(request: { kind: "measure"; clip: number } | { kind: "close" }): Promise<void> {
    try {
      const job = await ask<Job>("/api/jobs", "POST", request);
      await this.follow(job.id);
    } catch (fault) {
      this.say((fault as Error).message, true);
    }
  }

  /** Show a job until it ends. */
  async follow(id: number): Promise<void> {
    this.id = id;
    this.show(true);
    let job: Job;
    do {
      job = await ask<Job>(`/api/jobs/${id}`);
      this.progress(job);
      if (job.status === "running") await new Promise((resolve) => setTimeout(resolve, EVERY_MS));
    } while (job.status === "running");
    this.id = null;
    this.show(false);
    this.ended(job);
  }

  private progress(job: Job): void {
    const bar = byId<HTMLProgressElement>("progress");
    if (job.total > 0) {
      bar.max = job.total;
      bar.value = Math.min(job.done, job.total);
    } else bar.removeAttribute("value");
    const count = job.total > 0 ? `: ${job.done} of ${job.total} frames` : "";
    byId("progress-text").textContent = `${job.what}${count}`;
  }

  private show(isRunning: boolean): void {
    byId("job").hidden = !isRunning;
    for (const id of CHOICES) byId<HTMLButtonElement>(id).disabled = isRunning;
  }
}
