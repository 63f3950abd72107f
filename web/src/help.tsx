import { Dialog } from "./dialog";
import { set, useView } from "./store";
import { t } from "./strings";

export function HelpSheet() {
  const { state, about } = useView();
  return (
    <Dialog title={t.helpTitle} close={() => set({ sheet: state?.project ? "" : "open" })}>
      <dl class="keys">
        {t.keys.map(([keys, words]) => (
          <div key={keys}>
            <dt>
              <kbd>{keys}</kbd>
            </dt>
            <dd>{words}</dd>
          </div>
        ))}
      </dl>
      <p class="soft">
        {t.title} {about?.version}
      </p>
    </Dialog>
  );
}
