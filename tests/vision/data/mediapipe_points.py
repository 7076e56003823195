#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
#
# The 478 points that MediaPipe's own JavaScript pipeline finds in a picture, x y z in pixels, one a line:
#   python3 mediapipe_points.py PACKAGE rendered_face.png > mediapipe_points.txt
# PACKAGE: folder of @mediapipe/face_mesh 0.4.1633559619 (scripts/test.sh puts it into ~/.cache/lineament/npm). Needs
# chromium. Nothing is fetched: a server of this program gives the browser the files.
import http.server
import json
import pathlib
import subprocess
import sys
import tempfile
import threading

package, picture = map(pathlib.Path, sys.argv[1:3])
page = """<!doctype html><script src="face_mesh.js"></script><script>
const answer = value => fetch("answer", {method: "POST", body: JSON.stringify(value)});
window.onerror = message => answer({error: message});
const mesh = new FaceMesh({locateFile: file => file});
mesh.setOptions({maxNumFaces: 1, refineLandmarks: true, useCpuInference: true, minDetectionConfidence: 0.5});
mesh.onResults(results => {
    const faces = results.multiFaceLandmarks || [];
    answer({points: faces.length ? faces[0] : [], width: image.naturalWidth, height: image.naturalHeight});
});
const image = new Image();
image.onload = () => mesh.initialize().then(() => { mesh.reset(); return mesh.send({image}); })
    .catch(error => answer({error: String(error)}));
image.src = "picture";
</script>"""
answered = threading.Event()
answers = []


class Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        name = self.path.lstrip("/").split("?")[0]
        if name == "":
            body, kind = page.encode(), "text/html"
        elif name == "picture":
            body, kind = picture.read_bytes(), "image/png"
        elif "/" not in name and (package / name).is_file():
            body = (package / name).read_bytes()
            kind = {".js": "text/javascript", ".wasm": "application/wasm"}.get(pathlib.Path(name).suffix, "application/octet-stream")
        else:
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def do_POST(self):
        answers.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
        self.send_response(204)
        self.end_headers()
        answered.set()

    def log_message(self, *_):
        pass


server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
threading.Thread(target=server.serve_forever, daemon=True).start()
with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
    browser = subprocess.Popen(
        ["chromium", "--headless=new", "--no-sandbox", "--disable-background-networking", "--no-first-run",
         "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", f"--user-data-dir={profile}",
         f"http://127.0.0.1:{server.server_address[1]}/"], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    answered.wait(120)
    browser.terminate()
    browser.wait()
if not answers or not answers[0].get("points"):
    sys.exit(f"no points: {answers}")
for point in answers[0]["points"]:
    print(f"{point['x'] * answers[0]['width']:.3f} {point['y'] * answers[0]['height']:.3f} {point['z'] * answers[0]['width']:.3f}")
