"""@NAME@: a ray tracer for arhost. First what is seen along rays, then the plugin, from cameras to images.

By brute force: rays are tried on every object whose bounds they meet, and there on every triangle; numpy does so with
the rays of a few rows of the image at a time. All places are in the world, in mm."""
import arhost
import numpy as np

BAND = 1 << 12  # pixels that are drawn at a time: of all at once, no memory would hold a hundred reflections
CHUNK = 1 << 18  # rays times triangles that are tried at a time


def dot(a, b):
    return (a * b).sum(axis=-1)


def length(a):
    return np.sqrt(dot(a, a))


def normalised(a):
    return a / length(a)[..., None]


# ---- The scene. FILL IN: from here to the plugin is the part to replace ----

# What rays can hit, as bits. A shadow of glass is another than that of a solid body.
SOLID, GLASS, CATCHER, OCCLUDER, ANYTHING = 1, 2, 4, 8, 15


class Object:
    """An object in the world: spheres or triangles."""

    def __init__(self, record, material):
        self.material = material
        self.kind = {arhost.CATCHER: CATCHER, arhost.OCCLUDER: OCCLUDER}.get(
            int(record["role"]), GLASS if material["model"] == arhost.GLASS else SOLID)

    def place(self, scene, geometry, world_from_object, positions=None, normals=None):
        """Puts its geometry into the world; `positions` and `normals` stand for those of the scene."""
        axes, origin = np.split(world_from_object.astype(float).reshape(4, 3), [3])
        self.is_mesh = geometry["type"] == arhost.TRIANGLES
        if not self.is_mesh:
            spheres = scene.elements(geometry["positions"], "4f4").astype(float)
            self.centres, self.radii = spheres[:, :3] @ axes + origin, spheres[:, 3] * length(axes[0])
            return self.bound(self.centres, self.radii)
        if positions is None:
            positions = scene.elements(geometry["positions"], "3f4")
            normals = scene.elements(geometry["normals"], "3f4")
        indices = scene.elements(geometry["indices"], "3u4")
        corners = (positions.astype(float) @ axes + origin)[indices]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        usable = length(across) > 0  # the others have no area, no facet
        self.corner = corners[usable, 0]
        self.edge_1, self.edge_2 = corners[usable, 1] - self.corner, corners[usable, 2] - self.corner
        # Normals turn by the inverse's transpose. In a mirrored object its sign keeps the outside outside.
        sign = np.sign(np.linalg.det(axes))
        self.facets = sign * normalised(across[usable])
        self.normals = np.repeat(self.facets[:, None], 3, axis=1)
        if normals is not None and len(normals):
            self.normals = normalised(normals.astype(float) @ np.linalg.inv(axes).T)[indices[usable]]
        self.bound(corners.reshape(-1, 3), 0)

    def bound(self, centres, radii):
        """By a sphere about the middle of the box that holds all."""
        r = np.zeros((len(centres), 1)) + np.reshape(radii, (-1, 1))
        self.middle = ((centres - r).min(axis=0) + (centres + r).max(axis=0)) / 2
        self.radius = (length(centres - self.middle) + r[:, 0]).max() * (1 + 1e-9)  # rounding cuts no rim off


# ---- Rays and what they hit ----

def inside(centre, radius, origins, directions):
    """Where lines are inside a sphere, as distances along them; NaN where they miss."""
    to_centre = centre - origins
    middle = dot(to_centre, directions)
    aside = to_centre - middle[:, None] * directions
    squared = radius ** 2 - dot(aside, aside)
    half = np.sqrt(np.where(squared > 0, squared, np.nan))
    return middle - half, middle + half


class Hits:
    """The nearest hits of rays."""

    def __init__(self, count, end):
        self.distance = np.zeros(count) + end
        self.object = np.full(count, -1)  # its number; -1: the ray missed
        self.facet = np.zeros((count, 3))  # the flat normal
        self.normal = np.zeros((count, 3))  # and the interpolated one; length 1

    def take(self, rays, number, distance, facet, normal):
        nearer = (distance > 0) & (distance < self.distance[rays])  # false for NaN
        rays = rays[nearer]
        self.distance[rays], self.object[rays] = distance[nearer], number
        self.facet[rays], self.normal[rays] = facet[nearer], normal[nearer]


def try_spheres(hits, number, o, rays, origins, directions, only_outside):
    for centre, radius in zip(o.centres, o.radii):
        enters, leaves = inside(centre, radius, origins, directions)
        distance = enters if only_outside else np.where(enters > 0, enters, leaves)
        normal = (origins + distance[:, None] * directions - centre) / radius
        hits.take(rays, number, distance, normal, normal)


def try_triangles(hits, number, o, part, rays, origins, directions, only_outside):
    """Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, Journal of Graphics Tools 2(1), 1997. As
    scalar triple products: of rays times triangles these are products of matrices."""
    slack = 1e-9  # no ray may slip through between two triangles that share an edge
    corner, edge_1, edge_2 = o.corner[part], o.edge_1[part], o.edge_2[part]
    moments = np.cross(origins, directions)
    # (origin − corner) · (direction × edge) = edge · (origin × direction) − direction · (edge × corner)
    determinant = -directions @ np.cross(edge_1, edge_2).T
    u = (moments @ edge_2.T - directions @ np.cross(edge_2, corner).T) / determinant
    v = -(moments @ edge_1.T - directions @ np.cross(edge_1, corner).T) / determinant
    normals = np.cross(edge_1, edge_2)
    distance = (origins @ normals.T - dot(corner, normals)) / determinant
    hit = (u >= -slack) & (v >= -slack) & (u + v <= 1 + slack) & (distance > 0)
    if only_outside:
        hit &= directions @ o.facets[part].T <= 0
    distance = np.where(hit, distance, np.inf)
    which, every = distance.argmin(axis=1), np.arange(len(rays))
    nearest = distance[every, which]
    found = np.isfinite(nearest)
    if not found.any():
        return
    which, every = which[found], every[found]
    u, v = u[every, which, None], v[every, which, None]
    corners = o.normals[part][which]
    normal = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    hits.take(rays[found], number, nearest[found], o.facets[part][which], normalised(normal))


class Tracer:
    def __init__(self, scene, host):
        self.scene, self.host = scene, host
        self.objects = [Object(record, scene.materials[record["material"]]) for record in scene.objects]
        for number, record in enumerate(scene.objects):
            self.place(number, record["world_from_object"])

    def place(self, number, *where):
        self.objects[number].place(self.scene, self.scene.geometries[self.scene.objects[number]["geometry"]], *where)

    def move(self, moved, deformed):
        """Puts what moves where it is now."""
        places = {int(m["object"]): m["world_from_object"] for m in moved}
        for number, place in places.items():
            self.place(number, place)
        for d in deformed:
            place = places.get(d.object, self.scene.objects[d.object]["world_from_object"])
            self.place(d.object, place, d.positions, d.normals)

    def heed_cancelling(self):
        if self.host.cancelled():  # arhost wants to end: rays must not keep it waiting
            raise arhost.Failure("", arhost.ERROR_CANCELLED)

    def nearest(self, origins, directions, kinds, end=np.inf, only_outside=False):
        self.heed_cancelling()
        hits = Hits(len(origins), end)
        for number, o in enumerate(self.objects):
            if not o.kind & kinds:
                continue
            enters, leaves = inside(o.middle, o.radius, origins, directions)
            rays = np.flatnonzero((enters < hits.distance) & (leaves > 0))
            if len(rays) == 0:
                continue
            if not o.is_mesh:
                try_spheres(hits, number, o, rays, origins[rays], directions[rays], only_outside)
                continue
            step = max(1, CHUNK // len(rays))
            for first in range(0, len(o.corner), step):
                self.heed_cancelling()
                try_triangles(hits, number, o, slice(first, first + step), rays, origins[rays], directions[rays],
                              only_outside)
        return hits

    # ---- Light ----

    def incoming(self, light, surface):
        """A light as surfaces have it: directions to it, distances, cosines (0: it is behind), and the irradiance of
        what faces it. FILL IN: rectangles and spheres shine from their middle alone. Many points of theirs make soft
        shadows."""
        beam, irradiance = light["direction"].astype(float), np.ones(len(surface.position))
        if light["type"] == arhost.DIRECTIONAL_LIGHT:
            direction, distance = np.broadcast_to(-beam, surface.position.shape), np.inf * irradiance
        else:
            way = light["position"] - surface.position
            distance = length(way)
            direction = way / distance[:, None]
            if light["falloff"] == arhost.FALLOFF_INVERSE_SQUARE:
                irradiance = 1 / np.maximum(distance ** 2, 1e-6)
        along_beam = -direction @ beam
        if light["type"] == arhost.RECTANGLE_LIGHT:
            irradiance = irradiance * np.maximum(along_beam, 0)
        if light["type"] == arhost.SPOT_LIGHT:
            inner, outer = float(light["cosine_inner"]), float(light["cosine_outer"])
            t = np.clip((along_beam - outer) / max(inner - outer, 1e-6), 0, 1)
            irradiance = irradiance * t * t * (3 - 2 * t)
        cosine = np.where(dot(surface.facet, direction) > 0, np.maximum(dot(surface.normal, direction), 0), 0)
        return direction, distance, cosine, irradiance

    def ways_to(self, direction, distance, surface, facing):
        """Which of those that face a light are blocked, and which see it through glass. Real things cast no shadows
        on each other: those are in the video."""
        blocked, through_glass = np.zeros((2, len(facing)), bool)
        for real, opaque in ((False, SOLID | CATCHER | OCCLUDER), (True, SOLID)):
            some = np.flatnonzero(facing & (surface.is_real == real))
            rays = surface.position[some], direction[some]
            blocked[some] = self.nearest(*rays, opaque, distance[some]).object >= 0
            through_glass[some] = self.nearest(*rays, GLASS, distance[some]).object >= 0
        return blocked, through_glass & ~blocked

    def lit(self, surface, material, to_eye):
        """Lambert, and Phong's highlight."""
        light_out = np.zeros(surface.position.shape) + self.scene.ambient * material["ambient"] + material["emission"]
        for light in self.scene.lights:
            direction, distance, cosine, irradiance = self.incoming(light, surface)
            blocked, _ = self.ways_to(direction, distance, surface, cosine * irradiance > 0)
            reflected = cosine[:, None] * material["diffuse"]
            if material["model"] in (arhost.SPECULAR, arhost.METAL):
                mirrored = 2 * dot(surface.normal, direction)[:, None] * surface.normal - direction
                lobe = np.maximum(dot(mirrored, to_eye), 0) ** float(material["exponent"]) * (cosine > 0)
                reflected = reflected + lobe[:, None] * material["specular"]
            light_out += (irradiance * ~blocked)[:, None] * reflected * light["intensity"]
        return light_out

    def colours(self, origins, directions, hits, bounces=0):
        """FILL IN: there are no textures, no environment, no microfacets (metallic-roughness is drawn as Lambert), and
        glass does not bend light, nor reflect or colour any."""
        result = np.zeros(origins.shape) + self.scene.background
        for number in np.unique(hits.object[hits.object >= 0]):
            here = np.flatnonzero(hits.object == number)
            material, directions_here = self.objects[number].material, directions[here]
            surface = Surface(origins[here], directions_here, hits, here, self.objects[number].kind)
            cosine = -dot(directions_here, surface.normal)[:, None]
            mirrored = directions_here + 2 * cosine * surface.normal
            if material["model"] == arhost.MIRROR:
                colour = material["reflectivity"] * self.light_from(surface.position, mirrored, bounces + 1)
            elif material["model"] == arhost.METAL:
                rim = (1 - np.clip(cosine, 0, 1)) ** 5  # Schlick
                reflectance = (1 - rim) * material["reflectivity"] + rim
                colour = self.lit(surface, material, -directions_here) + \
                    reflectance * self.light_from(surface.position, mirrored, bounces + 1)
            elif material["model"] == arhost.GLASS:
                colour = material["refraction"] * self.light_from(surface.below, directions_here, bounces + 1)
            else:
                colour = self.lit(surface, material, -directions_here)
            result[here] = colour
        return result

    def light_from(self, origins, directions, bounces):
        if bounces > self.scene.max_depth:
            return np.zeros(origins.shape)
        return self.colours(origins, directions, self.nearest(origins, directions, ANYTHING), bounces)

    # ---- What lies over the video ----

    def shadow_alphas(self, surface):
        """The share of a catcher's light that virtual objects hide decides how dark it becomes."""
        total, alphas = np.zeros((2, len(surface.position)))
        for light in self.scene.lights:
            direction, distance, cosine, irradiance = self.incoming(light, surface)
            power = cosine * irradiance * light["intensity"].astype(float).sum()
            blocked, through_glass = self.ways_to(direction, distance, surface, power > 0)
            total += power
            alphas += power * np.where(blocked, self.scene.shadow_alpha_opaque, 0)
            alphas += power * np.where(through_glass, self.scene.shadow_alpha_translucent, 0)
        return np.divide(alphas, total, out=np.zeros(len(total)), where=total > 0)

    def look(self, origins, directions):
        """Colours, in linear light, and alphas: exactly 0 where the video shows, exactly 1 on virtual objects."""
        drawn = self.nearest(origins, directions, SOLID | GLASS | OCCLUDER)
        kinds = np.array([o.kind for o in self.objects] + [0])[drawn.object]  # -1: the last, of what missed
        virtual = (kinds & (SOLID | GLASS)) != 0
        drawn.object[~virtual] = -1
        alphas = virtual.astype(float)
        colours = self.colours(origins, directions, drawn) * virtual[:, None]
        # A catcher is in the video already. Only the shadow on it is missing there.
        rest = np.flatnonzero(~virtual)
        caught = self.nearest(origins[rest], directions[rest], CATCHER, drawn.distance[rest], only_outside=True)
        on_catcher = np.flatnonzero(caught.object >= 0)
        rest = rest[on_catcher]
        alphas[rest] = self.shadow_alphas(Surface(origins[rest], directions[rest], caught, on_catcher, CATCHER))
        return colours, alphas


class Surface:
    """Where rays have hit; `here` are their places in `hits`."""

    def __init__(self, origins, directions, hits, here, kind):
        distance = hits.distance[here, None]
        at = origins + distance * directions
        facet, normal = hits.facet[here], hits.normal[here]
        self.facet = np.where(dot(facet, directions)[:, None] > 0, -facet, facet)  # to where the rays came from
        self.normal = np.where(dot(normal, self.facet)[:, None] < 0, -normal, normal)
        gap = 1e-9 * (length(at)[:, None] + distance) * self.facet
        self.position, self.below = at + gap, at - gap  # rays that go on do not hit it again
        self.is_real = np.full(len(at), bool(kind & (CATCHER | OCCLUDER)))


# ---- The plugin ----

def srgb_bytes(linear):
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)
    return (255 * np.clip(encoded, 0, 1) + 0.5).astype(np.uint8)


class @CLASS@:
    # Further arguments are given in the YAML: options: {arguments: '{"colour": [0, 0.5, 1]}'}
    def __init__(self, host):
        self.host = host  # host.info("…") logs, host.cancelled() tells when to give up

    def start(self, setup):
        self.tracer = Tracer(setup.scene, self.host)

    def stop(self):
        self.tracer = None  # the scene is no longer there

    @np.errstate(divide="ignore", invalid="ignore")  # of rays that miss: NaN, which no comparison takes
    def render(self, request, image):
        camera, lens = request.camera, request.camera.intrinsics
        back = camera.eye - camera.look_at
        right = np.cross(camera.up, back)
        if not length(right) > 1e-9 * length(camera.up) * length(back):  # nor where a number is not finite
            raise arhost.Failure("the camera's up is parallel to its view", arhost.ERROR_INVALID_ARGUMENT)
        right, back = normalised(right), normalised(back)
        up = np.cross(back, right)
        self.tracer.move(request.moved, request.deformed)

        height, width = image.shape[:2]
        step = max(1, BAND // width)
        for first in range(0, height, step):
            band = image[first:first + step]
            # A ray a pixel. Pixel centres are at integers, rows run downwards, the camera looks along -back.
            rows, columns = np.mgrid[first:first + len(band), 0:width].reshape(2, -1)
            x, y = (columns - lens.cx) / lens.fx, (rows - lens.cy) / lens.fy
            directions = normalised(x[:, None] * right - y[:, None] * up - back)
            colours, alphas = self.tracer.look(np.broadcast_to(camera.eye, directions.shape), directions)
            # Alpha is straight: colours are not multiplied by it.
            band[..., :3] = srgb_bytes(colours).reshape(band.shape[:2] + (3,))
            band[..., 3] = (255 * alphas + 0.5).astype(np.uint8).reshape(band.shape[:2])
