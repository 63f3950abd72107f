import { Choice } from "./controls";
import { chooseTheme, chosenTheme, type Theme } from "./theme";
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
      <section class="choose-theme">
        <h3>{t.theme}</h3>
        <Choice
          label={t.theme}
          value={chosenTheme()}
          options={[["system", t.themeSystem], ["dark", t.themeDark], ["light", t.themeLight]]}
          changed={(value) => {
            chooseTheme(value as Theme);
            set({});
          }}
        />
      </section>
      <p class="soft">
        {t.title} {about?.version}
      </p>
    </Dialog>
  );
}
