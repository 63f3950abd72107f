// The sheet that opens photos: dropped, recent, or an example.
import { useEffect, useState } from "preact/hooks";
import { address } from "./api";
import { FileButton, Fold } from "./controls";
import { Dialog } from "./dialog";
import { Icon } from "./icons";
import { change, editProjects, listProjects, openFile, set, start, useView, view } from "./store";
import { t } from "./strings";
import type { Project } from "./types";

export function OpenSheet() {
  const { about, projects, state, size, predictor, fov } = useView();
  const held = !!(state?.project || state?.expected);
  // Another tab may have renamed or deleted photos.
  useEffect(() => void listProjects(), []);
  const accept = ["image/*", ".zip", ...(about?.photos ?? [])].join(",");
  return (
    <Dialog title={t.openTitle} kind={held ? "open" : "open first"} close={held ? () => set({ sheet: "" }) : undefined}>
      {!held && <p class="tagline">{t.tagline}</p>}
      <div class="target">
        <Icon name="photos" />
        <p>{t.dropHere}</p>
        <FileButton kind="primary" label={t.choose} accept={accept} chosen={(file) => void openFile(file)} />
        <p class="soft">{t.dropHint}</p>
      </div>
      {projects.length > 0 && (
        <section>
          <h3>{t.recent}</h3>
          <ul class="photos-list" id="projects">
            {projects.map((project) => (
              <Card key={project.name} project={project} />
            ))}
          </ul>
        </section>
      )}
      <section>
        <h3>{t.examples}</h3>
        <ul class="photos-list" id="examples">
          {about?.examples.map(([name, title, credit]) => (
            <li key={name}>
              <button class="photo" title={credit || title} onClick={() => void start({ example: name })}>
                <img src={address(`example/${name}`)} alt="" loading="lazy" />
                <span>{title}</span>
              </button>
            </li>
          ))}
        </ul>
      </section>
      <Fold title={t.settings}>
        <div class="settings">
          <label>
            <span>{t.workingSize}</span>
            <select value={size} onChange={(event) => set({ size: Number(event.currentTarget.value) })}>
              {about?.sizes.map((side) => (
                <option key={side} value={side}>
                  {side}
                </option>
              ))}
            </select>
            <small>{t.workingHint}</small>
          </label>
          <label>
            <span>{t.predictor}</span>
            <select value={predictor} onChange={(event) => set({ predictor: event.currentTarget.value })}>
              {about?.predictors.map(([title, name]) => (
                <option key={name} value={name}>
                  {title}
                </option>
              ))}
            </select>
          </label>
          <label>
            <span>{t.fov}</span>
            <input value={fov} maxLength={10} onChange={(event) => set({ fov: event.currentTarget.value.trim() || "auto" })} />
          </label>
        </div>
      </Fold>
    </Dialog>
  );
}

function Card({ project }: { project: Project }) {
  const [naming, setNaming] = useState(false);
  const [asking, setAsking] = useState(false);
  const open = () => {
    set({ sheet: "" });
    void change("open", { project: project.name }, "", t.opening).then(() => {
      if (!view.state?.project && !view.state?.expected) set({ sheet: "open" });
    });
  };
  const current = view.state?.project?.name === project.name;
  return (
    <li class={current ? "current" : ""}>
      <button class="photo" onClick={open} title={project.title}>
        <img src={address(`picture/${project.name}/photo`)} alt="" loading="lazy" />
        {!naming && <span>{project.title}</span>}
        {!project.ready && <em>{t.inWork}</em>}
      </button>
      {naming ? (
        <input
          class="title"
          value={project.title}
          maxLength={60}
          aria-label={t.newTitle}
          ref={(input) => input?.focus()}
          onBlur={(event) => {
            const title = event.currentTarget.value.trim();
            setNaming(false);
            if (title && title !== project.title) void editProjects("rename", { project: project.name, title });
          }}
          onKeyDown={(event) => {
            if (event.key === "Enter") event.currentTarget.blur();
            if (event.key !== "Escape") return;
            event.stopPropagation();
            setNaming(false);
          }}
        />
      ) : (
        <span class="tend">
          <button class="icon-only" aria-label={`${t.rename}: ${project.title}`} title={t.rename} onClick={() => setNaming(true)}>
            <Icon name="pen" />
          </button>
          <button class="icon-only" aria-label={`${t.discard}: ${project.title}`} title={t.discard} onClick={() => setAsking(true)}>
            <Icon name="bin" />
          </button>
        </span>
      )}
      {asking && (
        <div class="ask" role="alertdialog" aria-label={t.sure(project.title)}>
          <p>{t.sure(project.title)}</p>
          <button class="danger" ref={(button) => button?.focus()} onClick={() => void editProjects("discard", { project: project.name })}>
            {t.discard}
          </button>
          <button class="quiet" onClick={() => setAsking(false)}>
            {t.close}
          </button>
        </div>
      )}
    </li>
  );
}
