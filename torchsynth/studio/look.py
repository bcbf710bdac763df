"""How the page looks: calm, with one accent color, in the fonts that the machine has."""

from __future__ import annotations

from torchsynth.studio.toolkit import gr

_FONTS = ("system-ui", "-apple-system", "Segoe UI", "Roboto", "Noto Sans", "sans-serif")
_FIXED_WIDTH = ("ui-monospace", "SFMono-Regular", "Menlo", "Consolas", "DejaVu Sans Mono", "monospace")


def theme() -> gr.themes.Base:
    """Gradio's plain theme in grays and one accent.

    Example:
        >>> "https" in theme()._font_css
        False
    """
    return gr.themes.Base(
        primary_hue="teal",
        secondary_hue="teal",
        neutral_hue="stone",
        radius_size="sm",
        spacing_size="sm",
        text_size="sm",
        font=_FONTS,
        font_mono=_FIXED_WIDTH,
    ).set(
        body_background_fill="*neutral_50",
        body_background_fill_dark="*neutral_950",
        block_background_fill="white",
        block_background_fill_dark="*neutral_900",
        body_text_color_subdued="*neutral_600",
        body_text_color_subdued_dark="*neutral_400",
        block_border_width="1px",
        block_border_color="*neutral_200",
        block_border_color_dark="*neutral_800",
        block_label_background_fill="transparent",
        block_label_background_fill_dark="transparent",
        block_label_border_width="0px",
        block_label_text_color="*neutral_500",
        input_background_fill="white",
        input_background_fill_dark="*neutral_900",
        input_border_width="1px",
        input_border_color="*neutral_300",
        input_border_color_dark="*neutral_700",
        button_secondary_background_fill="white",
        button_secondary_background_fill_hover="*neutral_100",
        button_secondary_background_fill_dark="*neutral_800",
        button_secondary_background_fill_hover_dark="*neutral_700",
        button_secondary_border_color="*neutral_300",
        button_secondary_border_color_dark="*neutral_700",
        button_border_width="1px",
        button_primary_border_color="transparent",
        checkbox_background_color_selected="*primary_700",
        checkbox_border_color_selected="*primary_700",
        slider_color="*primary_700",
        button_primary_background_fill="*primary_700",
        button_primary_background_fill_hover="*primary_800",
        button_primary_background_fill_dark="*primary_600",
        button_primary_background_fill_hover_dark="*primary_500",
        button_primary_text_color="white",
    )


CSS = """
.gradio-container, .gradio-container > main { max-width: 1500px !important; width: 100% !important; margin: 0 auto !important; }
.gradio-container > main { padding: 14px 20px 84px !important; }
.html-container { padding: 0 !important; }
#title { display: flex; align-items: baseline; gap: 12px; }
#title h1 { font-size: 19px; font-weight: 650; letter-spacing: -.01em; margin: 0; color: var(--body-text-color); }
#title p, .hint { color: var(--body-text-color-subdued); margin: 0; font-size: 13px; line-height: 1.45; }
.hint b { color: var(--body-text-color); font-weight: 600; }
.section { font-size: 11px; font-weight: 650; letter-spacing: .07em; text-transform: uppercase;
  color: var(--body-text-color-subdued); padding-top: 6px; }

/* The side stays; beside it the tabs, what they make, and its levels. */
#side { flex: 0 0 300px !important; min-width: 280px !important; gap: 8px; }
#main { min-width: 420px !important; gap: 10px; }
#work { display: grid; grid-template-columns: minmax(0, 1fr); gap: 12px; align-items: start; }
@media (min-width: 1180px) {
  #work:has(button[data-tab-id=target].selected), #work:has(button[data-tab-id=fill].selected) { grid-template-columns: minmax(0, 1fr) minmax(0, 1fr); }
  #levels { grid-column: 1 / -1; }
  #work:has(button[data-tab-id=target].selected, button[data-tab-id=fill].selected) #shown-field { display: none; }
}
#work:has(button[data-tab-id=compare].selected) :is(#output, #levels) { display: none; }
#output, #levels, .tabitem, .tabitem > .column { gap: 8px !important; }
.tabitem { padding: 10px 0 0 !important; border: 0 !important; }
.actions { align-items: flex-end !important; gap: 8px !important; }
.actions button { height: 36px; font-size: 14px; font-weight: 600; white-space: nowrap; }
.form { background: none !important; border: 0 !important; box-shadow: none !important; gap: 10px !important; overflow: visible !important; }
.form > .block { background: none !important; border: 0 !important; padding: 0 !important; }
.actions .form { flex-grow: 0 !important; }
.tab-container button { padding-inline: 9px !important; font-size: 14px !important; }
button[role=tab].selected { color: var(--primary-700) !important; }
.dark button[role=tab].selected { color: var(--primary-400) !important; }

/* Pixels are the matter here: never smooth them. */
#sample img, #shown-result img, #shown-field img, .pair img, .pyramids img, #thumbnails img { image-rendering: pixelated; }
#sample img { width: 100%; height: 100%; object-fit: contain; cursor: crosshair; }
#shown-result img, #shown-field img, .pair img { width: 100%; height: 100%; object-fit: contain; }
#thumbnails { background: none; border: 0 !important; height: auto !important; min-height: 0 !important; }
#thumbnails > * { min-height: 0 !important; }
#thumbnails .gallery-container { height: auto !important; }
#thumbnails .grid-wrap { min-height: 0 !important; max-height: none !important; height: auto !important; padding: 0; overflow: visible; }
#thumbnails .grid-container { height: auto !important; grid-template-rows: auto !important; grid-template-columns: repeat(4, 1fr) !important; gap: 6px; padding: 0; margin: 0; }
#thumbnails .gallery-item { height: auto !important; }
#thumbnails .thumbnail-item { width: 100% !important; height: auto !important; aspect-ratio: 1; border-radius: 3px; overflow: hidden; }
#thumbnails .caption-label { display: none; }

.painter { border: 1px solid var(--block-border-color); border-radius: 4px; background: var(--block-background-fill); padding: 8px; }
.painter-tools { display: flex; flex-wrap: wrap; align-items: center; gap: 8px 12px; margin-bottom: 8px; }
.swatches, .tools { display: flex; flex-wrap: wrap; gap: 5px; align-items: center; }
.swatch { width: 22px; height: 22px; border-radius: 4px; border: 1px solid rgba(128, 128, 128, .5); cursor: pointer; }
.swatch.chosen { outline: 2px solid var(--primary-600); outline-offset: 1px; }
.painter input[type=color] { width: 26px; height: 24px; padding: 0; border: 0; background: none; cursor: pointer; }
.painter .width { display: flex; align-items: center; gap: 6px; font-size: 12.5px; color: var(--body-text-color-subdued); }
.painter input[type=range] { width: 70px; accent-color: var(--primary-600); }
.tool { font-size: 12.5px; padding: 2px 8px; border-radius: 4px; border: 1px solid var(--block-border-color);
  color: var(--body-text-color); background: none; cursor: pointer; }
.tool:hover, .tool.chosen { background: var(--neutral-100); }
.dark .tool:hover, .dark .tool.chosen { background: var(--neutral-800); }
.painter-paper { position: relative; margin: 0 auto; background: #ececea; touch-action: none; }
.dark .painter-paper { background: #33312f; }
.painter-paper :is(img, canvas) { position: absolute; inset: 0; width: 100%; height: 100%; margin: 0; cursor: crosshair;
  image-rendering: pixelated; }
#hole canvas { opacity: .8; }

#status { position: fixed; left: 0; right: 0; bottom: 0; z-index: 20; align-items: center; flex-wrap: nowrap; gap: 16px;
  padding: 10px max(20px, calc(50vw - 730px)) 10px; background: var(--body-background-fill);
  border-top: 1px solid var(--block-border-color); }
#status:has(.bar:not(.running)) #cancel { opacity: .45; pointer-events: none; }
.bar { height: 6px; border-radius: 3px; background: var(--neutral-200); overflow: hidden; }
.dark .bar { background: var(--neutral-800); }
.bar .done { height: 100%; background: var(--primary-600); border-radius: 3px; transition: width .15s linear; }
.bar.cancelled .done, .bar.failed .done { background: var(--neutral-400); }
.said { font-size: 12.5px; margin-top: 5px; min-height: 18px; color: var(--body-text-color-subdued);
  font-variant-numeric: tabular-nums; }
.said.failed { color: #b42318; }
.dark .said.failed { color: #f97066; }

#levels, #levels > *, #pyramids { min-width: 0 !important; max-width: 100%; }
#pyramids { overflow-x: auto !important; }
table.pyramids, table.measures { border: 0 !important; }
table.pyramids { border-collapse: separate; border-spacing: 0; margin: 0; }
table.pyramids :is(th, td) { font-weight: 500; font-size: 12px; text-align: left; padding: 0 12px 8px 0; border: 0;
  color: var(--body-text-color-subdued); vertical-align: top; white-space: nowrap; }
table.pyramids thead :is(th, td) { padding-bottom: 4px; }
table.pyramids figure { margin: 0; }
table.pyramids img, .waiting { display: block; max-width: none; width: 132px; height: 132px; object-fit: contain; object-position: left top;
  margin: 0; border-radius: 2px; }
.waiting { background: var(--neutral-100); }
.dark .waiting { background: var(--neutral-800); }
table.pyramids figcaption { font-size: 11px; font-variant-numeric: tabular-nums; margin: 2px 0 0; }

#measures { overflow-x: auto; }
table.measures { border-collapse: collapse; margin: 4px 0 0; font-size: 13px; font-variant-numeric: tabular-nums; width: 100%; }
table.measures :is(th, td) { padding: 7px 16px 7px 0; border: 0 !important; border-bottom: 1px solid var(--block-border-color) !important;
  text-align: left; color: var(--body-text-color); }
table.measures, table.measures :is(thead, tbody, tr) { border: 0 !important; }
table.measures th { font-weight: 500; color: var(--body-text-color-subdued); }
footer { display: none !important; }
"""
"""What the theme does not say."""
