# SPDX-License-Identifier: Apache-2.0
"""Pictures for docs/images/, made by ffmpeg."""
import subprocess
import tempfile


def picture(inputs, filters, output, quality=3):
    sources = [word for file in inputs for word in ("-i", file)]
    subprocess.run(["ffmpeg", "-v", "error", "-y", *sources, "-filter_complex", filters, "-frames:v", "1", "-q:v", str(quality), output],
                   check=True)


def tile(files, captions, columns, panel, output, quality=3):
    """Puts pictures side by side, with captions below them. `panel`: filters of ffmpeg for each picture."""
    with tempfile.TemporaryDirectory() as folder:
        parts = []
        for i, caption in enumerate(captions):
            text = f"{folder}/caption-{i}.txt"
            with open(text, "w", encoding="utf-8") as file:
                file.write(caption)
            parts.append(f"[{i}]{panel},pad=iw:ih+34:0:0:white,"
                         f"drawtext=textfile={text}:expansion=none:x=4:y=h-26:fontsize=20:fontcolor=black[p{i}];")
        inputs = "".join(f"[p{i}]" for i in range(len(files)))
        rows = -(-len(files) // columns)
        picture(files, "".join(parts) + f"{inputs}concat=n={len(files)},tile={columns}x{rows}:padding=8:color=white", output, quality)
