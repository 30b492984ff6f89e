#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Servers for the tests of source_network: server.py rtsp|http|https ADDRESS[:PORT] FOLDER.

Prints the port, then serves until it is killed. FOLDER contains 00.jpg to 15.jpg, which the cameras show in a loop, and
the files of an HLS stream. USER and SECRET are the credentials of everything in /private.
"""
import base64
import http.server
import itertools
import pathlib
import ssl
import sys
import time

USER, SECRET = "camera", "s3cr:t@/"
RATE = 25


def pictures(folder):
    return [path.read_bytes() for path in sorted(folder.glob("[0-9][0-9].jpg"))]


class Camera(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.0"

    def do_GET(self):
        name = self.path.partition("?")[0].strip("/")
        if name.startswith("private/"):
            expected = "Basic " + base64.b64encode(f"{USER}:{SECRET}".encode()).decode()
            if self.headers.get("Authorization") != expected:
                self.send_response(401)
                self.send_header("WWW-Authenticate", 'Basic realm="camera"')
                self.end_headers()
                return
            name = name.removeprefix("private/")
        route = getattr(self, "send_" + name.replace(".", "_").replace("/", "_"), None)
        if route:
            try:
                route()
            except OSError:
                pass  # the client has closed the connection
        elif (self.server.folder / name).is_file():
            self.send_bytes((self.server.folder / name).read_bytes())
        else:
            self.send_error(404)

    def send_bytes(self, body, kind="application/octet-stream"):
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def stream(self, parts, excess=0):
        """`excess`: what Content-Length adds to the true length."""
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        for part in parts:
            head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(part) + excess}\r\n\r\n"
            self.wfile.write(head.encode() + part + b"\r\n")
            self.wfile.flush()
            time.sleep(1 / RATE)

    def send_mjpeg(self):
        self.stream(itertools.cycle(self.server.pictures))

    def send_truncated(self):
        """Every second picture lacks its second half."""
        halved = [p if i % 2 == 0 else p[: len(p) // 2] for i, p in enumerate(self.server.pictures)]
        self.stream(itertools.cycle(halved))

    def send_short_lengths(self):
        self.stream(itertools.cycle(self.server.pictures), -200)

    def send_long_lengths(self):
        self.stream(itertools.cycle(self.server.pictures), 30)

    def send_broken(self):
        """No picture is complete."""
        self.stream(itertools.cycle(p[: len(p) // 2] for p in self.server.pictures))

    def send_stalls(self):
        """Sends ten pictures, then keeps the connection without sending."""
        self.stream(self.server.pictures[:10])
        time.sleep(3600)

    def send_grows(self):
        """The size of the pictures changes."""
        self.stream(itertools.chain(self.server.pictures, itertools.repeat((self.server.folder / "large").read_bytes())))

    def send_joined_ts(self):
        """Two joined videos. The time stamps and counters of the second one begin again."""
        self.send_bytes(2 * (self.server.folder / "hls0.ts").read_bytes())

    def send_silent(self):
        time.sleep(3600)

    def send_garbage(self):
        self.send_bytes(bytes(i * i % 251 for i in range(1 << 20)))

    def send_live_m3u8(self):
        """A playlist of a live stream: a window of three segments that advances each second."""
        first = int(time.monotonic() - self.server.begin)
        names = [f"hls{i}.ts" for i in range(first, first + 3)]
        self.playlist(names, f"#EXT-X-MEDIA-SEQUENCE:{first}\n")

    def playlist(self, names, more=""):
        lines = "".join(f"#EXTINF:1.0,\n{name}\n" for name in names)
        text = f"#EXTM3U\n#EXT-X-VERSION:3\n#EXT-X-TARGETDURATION:1\n{more}{lines}"
        self.send_bytes(text.encode(), "application/vnd.apple.mpegurl")

    def send_passwd_m3u8(self):
        self.playlist(["file:///etc/passwd"], "#EXT-X-ALLOW-CACHE:NO\n")

    def send_files_m3u8(self):
        """Names files that would be playable."""
        self.playlist([f"file://{self.server.folder}/hls{i}.ts" for i in range(3)])

    def send_list(self):
        """A list of files for libav's concat demuxer."""
        self.send_bytes(f"ffconcat version 1.0\nfile '{self.server.folder}/hls0.ts'\n".encode())

    def send_redirect(self):
        self.send_response(302)
        self.send_header("Location", f"file://{self.server.folder}/hls0.ts")
        self.end_headers()

    def log_message(self, *_):
        pass


def serve_http(address, port, folder, encrypted):
    server = http.server.ThreadingHTTPServer((address, port), Camera)
    server.folder, server.pictures, server.begin = folder, pictures(folder), time.monotonic()
    if encrypted:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(folder / "certificate.pem", folder / "key.pem")
        server.socket = context.wrap_socket(server.socket, server_side=True)
    print(server.server_address[1], flush=True)
    server.serve_forever()


def serve_rtsp(address, port, folder):
    import gi

    gi.require_version("Gst", "1.0")
    gi.require_version("GstRtspServer", "1.0")
    from gi.repository import GLib, Gst, GstRtspServer

    Gst.init(None)
    server = GstRtspServer.RTSPServer(address=address, service=str(port))
    camera = f'multifilesrc location="{folder}/%02d.jpg" loop=true caps=image/jpeg,framerate={RATE}/1'
    h264 = "jpegdec ! x264enc tune=zerolatency speed-preset=ultrafast key-int-max=10 qp-max=10 ! rtph264pay name=pay0 pt=96"
    jpeg = "jpegdec ! jpegenc quality=95 ! rtpjpegpay name=pay0 pt=26"
    sound = "audiotestsrc is-live=true ! alawenc ! rtppcmapay name=pay1 pt=8"

    token = GstRtspServer.RTSPToken()
    token.set_string(GstRtspServer.RTSP_TOKEN_MEDIA_FACTORY_ROLE, "viewer")
    auth = GstRtspServer.RTSPAuth()
    auth.add_basic(GstRtspServer.RTSPAuth.make_basic(USER, SECRET), token)
    anyone = GstRtspServer.RTSPToken()
    anyone.set_string(GstRtspServer.RTSP_TOKEN_MEDIA_FACTORY_ROLE, "anyone")
    auth.set_default_token(anyone)
    server.set_auth(auth)

    for path, pipeline, roles in [
        ("/h264", f"( {camera} ! {h264} )", ["anyone", "viewer"]),
        ("/jpeg", f"( {camera} ! {jpeg} )", ["anyone", "viewer"]),
        ("/sound", f"( {camera} ! {h264}  {sound} )", ["anyone", "viewer"]),
        ("/only-sound", f"( {sound.replace('pay1', 'pay0')} )", ["anyone", "viewer"]),
        ("/private", f"( {camera} ! {h264} )", ["viewer"]),
    ]:
        factory = GstRtspServer.RTSPMediaFactory(launch=pipeline, shared=True)
        for role in ["anyone", "viewer"]:
            permissions = Gst.Structure.new_empty(role)
            permissions.set_value(GstRtspServer.RTSP_PERM_MEDIA_FACTORY_ACCESS, True)
            permissions.set_value(GstRtspServer.RTSP_PERM_MEDIA_FACTORY_CONSTRUCT, role in roles)
            factory.add_role_from_structure(permissions)
        server.get_mount_points().add_factory(path, factory)
    server.attach(None)
    print(server.get_bound_port(), flush=True)
    GLib.MainLoop().run()


protocol, place, folder = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
host, _, number = place.partition(":")
if protocol == "rtsp":
    serve_rtsp(host, int(number or 0), folder)
else:
    serve_http(host, int(number or 0), folder, protocol == "https")
