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
        block_border_width="1px",
        block_border_color="*neutral_200",
        block_border_color_dark="*neutral_800",
        block_label_background_fill="transparent",
        block_label_background_fill_dark="transparent",
        block_label_border_width="0px",
        block_label_text_color="*neutral_500",
        button_primary_background_fill="*primary_700",
        button_primary_background_fill_hover="*primary_800",
        button_primary_background_fill_dark="*primary_600",
        button_primary_background_fill_hover_dark="*primary_500",
        button_primary_text_color="white",
    )


CSS = """
.gradio-container { max-width: 1480px !important; margin: 0 auto !important; padding: 16px 20px !important; }
#title { display: flex; align-items: baseline; gap: 12px; margin: 0 0 4px; }
#title h1 { font-size: 20px; font-weight: 650; letter-spacing: -0.01em; margin: 0; }
#title p { color: var(--body-text-color-subdued); margin: 0; font-size: 13px; }
.section { font-size: 11px; font-weight: 650; letter-spacing: .07em; text-transform: uppercase;
  color: var(--body-text-color-subdued); margin: 4px 0 -4px; }
.hint { color: var(--body-text-color-subdued); font-size: 12.5px; line-height: 1.45; }
#side { flex: 0 0 312px !important; min-width: 290px !important; }
#main { min-width: 420px !important; }

/* Pixels are the matter here: never smooth them. */
#sample img, #result img, #drawing img, .pair img, .pyramids img, #thumbnails img, canvas
  { image-rendering: pixelated; }
#sample img { width: 100%; height: 100%; object-fit: contain; cursor: crosshair; }
#result img, #drawing img, .pair img { width: 100%; height: 100%; object-fit: contain; }

.bar { height: 6px; border-radius: 3px; background: var(--neutral-200); overflow: hidden; }
.dark .bar { background: var(--neutral-800); }
.bar .done { height: 100%; background: var(--primary-600); border-radius: 3px; transition: width .15s linear; }
.bar.cancelled .done, .bar.failed .done { background: var(--neutral-400); }
.said { font-size: 12.5px; margin-top: 5px; min-height: 18px; color: var(--body-text-color-subdued);
  font-variant-numeric: tabular-nums; }
.said.failed { color: #b42318; }
.dark .said.failed { color: #f97066; }

table.pyramids { border-collapse: separate; border-spacing: 10px 6px; margin: -4px -10px; }
table.pyramids th { font-weight: 500; font-size: 12px; color: var(--body-text-color-subdued); text-align: left;
  padding: 0; border: 0; background: none; }
table.pyramids td, table.pyramids tr, table.pyramids thead { border: 0 !important; padding: 0; background: none; vertical-align: top; }
table.pyramids th[scope=row] { width: 52px; vertical-align: top; padding-top: 2px; }
table.pyramids figure { margin: 0; }
table.pyramids img, .waiting { display: block; width: 132px; height: 132px; object-fit: contain; object-position: left top; margin: 0;
  border-radius: 2px; }
.waiting { background: var(--neutral-100); }
.dark .waiting { background: var(--neutral-800); }
table.pyramids figcaption { font-size: 11px; color: var(--body-text-color-subdued); font-variant-numeric: tabular-nums; margin: 2px 0 0; }
#pyramids { overflow-x: auto; }

table.measures { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; width: 100%; }
table.measures th, table.measures td { padding: 5px 10px 5px 0; border: 0; border-bottom: 1px solid var(--block-border-color);
  text-align: left; background: none; }
table.measures th { font-weight: 500; color: var(--body-text-color-subdued); }
footer { display: none !important; }
"""
"""What the theme does not say."""
