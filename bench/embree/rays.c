/* Embree's single-ray caster as a peer of `bench rays`: commands come on standard input, one a line, answers go to standard output.
 *
 *   mesh FILE        reads a mesh and builds its tree     -> built SECONDS BYTES
 *   rays FILE        reads the next set of rays           -> rays COUNT
 *   closest SET      the nearest hit of every ray         -> time SECONDS
 *   occluded SET     whether anything is hit              -> time SECONDS
 *   hits SET FILE    nearest hits into a file             -> written
 *
 * Files hold little-endian 32-bit numbers. A mesh: number of vertices, number of triangles, x y z of each vertex, three indices of each
 * triangle. Rays: their number; origin, direction, end of each. Hits: triangle (ffffffff: none) and parameter of each.
 *
 * The scene is built robust and with high quality; the device takes the best instruction set of the machine.
 * Build: see ../README.md. Embree 3 and 4. */

#ifdef EMBREE4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <time.h>

#define MAX_SETS 64

struct ray {
    float o[3], d[3], end;
};

struct set {
    uint32_t count;
    struct ray *rays;
};

static ssize_t tree_bytes;

static void fail(const char *what, const char *name) {
    fprintf(stderr, "embree peer: %s %s\n", what, name);
    exit(1);
}

static double seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static bool count_bytes(void *context, ssize_t bytes, bool after) {
    (void)context, (void)after;
    __atomic_fetch_add(&tree_bytes, bytes, __ATOMIC_RELAXED);
    return true;
}

static void report(void *context, enum RTCError code, const char *text) {
    (void)context;
    fprintf(stderr, "embree peer: error %d: %s\n", (int)code, text);
    exit(1);
}

static void read_all(FILE *file, const char *name, void *to, size_t size, size_t count) {
    if (fread(to, size, count, file) != count)
        fail("too short:", name);
}

static FILE *open_file(const char *name, const char *mode) {
    FILE *file = fopen(name, mode);
    if (!file)
        fail("cannot open", name);
    return file;
}

static RTCScene read_mesh(RTCDevice device, const char *name, double *build_seconds) {
    FILE *file = open_file(name, "rb");
    uint32_t counts[2];
    read_all(file, name, counts, sizeof(uint32_t), 2);
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void *vertices =
        rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), counts[0]);
    void *triangles =
        rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), counts[1]);
    read_all(file, name, vertices, 3 * sizeof(float), counts[0]);
    read_all(file, name, triangles, 3 * sizeof(uint32_t), counts[1]);
    fclose(file);
    /* The mesh itself does not count. */
    tree_bytes = 0;
    double start = seconds();
    rtcCommitGeometry(mesh);
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    rtcAttachGeometry(scene, mesh);
    rtcCommitScene(scene);
    *build_seconds = seconds() - start;
    rtcReleaseGeometry(mesh);
    return scene;
}

static struct set read_rays(const char *name) {
    FILE *file = open_file(name, "rb");
    struct set set;
    read_all(file, name, &set.count, sizeof(uint32_t), 1);
    set.rays = malloc(set.count * sizeof(struct ray));
    if (!set.rays)
        fail("no memory for", name);
    read_all(file, name, set.rays, sizeof(struct ray), set.count);
    fclose(file);
    return set;
}

static inline void set_ray(struct RTCRay *to, const struct ray *from) {
    to->org_x = from->o[0], to->org_y = from->o[1], to->org_z = from->o[2];
    to->dir_x = from->d[0], to->dir_y = from->d[1], to->dir_z = from->d[2];
    to->tnear = 0, to->tfar = from->end, to->time = 0;
    to->mask = 0xffffffffu, to->id = 0, to->flags = 0;
}

static inline void closest(RTCScene scene, const struct ray *ray, struct RTCRayHit *hit) {
    set_ray(&hit->ray, ray);
    hit->hit.geomID = RTC_INVALID_GEOMETRY_ID;
    hit->hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#ifdef EMBREE4
    rtcIntersect1(scene, hit, NULL);
#else
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene, &context, hit);
#endif
}

static inline bool occluded(RTCScene scene, const struct ray *ray) {
    struct RTCRay shadow;
    set_ray(&shadow, ray);
#ifdef EMBREE4
    rtcOccluded1(scene, &shadow, NULL);
#else
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene, &context, &shadow);
#endif
    return shadow.tfar < 0;
}

static double time_closest(RTCScene scene, const struct set *set) {
    struct RTCRayHit hit;
    volatile uint64_t sink;
    uint64_t sum = 0;
    double start = seconds();
    for (uint32_t i = 0; i < set->count; i++) {
        closest(scene, &set->rays[i], &hit);
        if (hit.hit.geomID != RTC_INVALID_GEOMETRY_ID)
            sum += hit.hit.primID;
    }
    sink = sum;
    (void)sink;
    return seconds() - start;
}

static double time_occluded(RTCScene scene, const struct set *set) {
    volatile uint64_t sink;
    uint64_t sum = 0;
    double start = seconds();
    for (uint32_t i = 0; i < set->count; i++)
        sum += occluded(scene, &set->rays[i]);
    sink = sum;
    (void)sink;
    return seconds() - start;
}

static void write_hits(RTCScene scene, const struct set *set, const char *name) {
    FILE *file = open_file(name, "wb");
    struct RTCRayHit hit;
    for (uint32_t i = 0; i < set->count; i++) {
        closest(scene, &set->rays[i], &hit);
        uint32_t id = hit.hit.geomID == RTC_INVALID_GEOMETRY_ID ? 0xffffffffu : hit.hit.primID;
        fwrite(&id, sizeof(id), 1, file);
        fwrite(&hit.ray.tfar, sizeof(float), 1, file);
    }
    if (fclose(file))
        fail("cannot write", name);
}

int main(int argc, char **argv) {
#if defined(__x86_64__)
    /* Flush denormals, as Embree's documentation advises. */
    _mm_setcsr(_mm_getcsr() | 0x8040);
#endif
    RTCDevice device = rtcNewDevice(argc > 1 ? argv[1] : NULL);
    if (!device)
        fail("no device", "");
    rtcSetDeviceErrorFunction(device, report, NULL);
    rtcSetDeviceMemoryMonitorFunction(device, count_bytes, NULL);
    RTCScene scene = NULL;
    static struct set sets[MAX_SETS];
    unsigned known = 0, at;
    char line[4096], name[4096];
    while (fgets(line, sizeof(line), stdin)) {
        line[strcspn(line, "\n")] = 0;
        if (sscanf(line, "mesh %4095[^\n]", name) == 1) {
            if (scene)
                rtcReleaseScene(scene);
            while (known)
                free(sets[--known].rays);
            double took;
            scene = read_mesh(device, name, &took);
            printf("built %.6f %zd\n", took, __atomic_load_n(&tree_bytes, __ATOMIC_RELAXED));
        } else if (sscanf(line, "rays %4095[^\n]", name) == 1 && known < MAX_SETS) {
            sets[known] = read_rays(name);
            printf("rays %" PRIu32 "\n", sets[known++].count);
        } else if (sscanf(line, "closest %u", &at) == 1 && at < known && scene) {
            printf("time %.9f\n", time_closest(scene, &sets[at]));
        } else if (sscanf(line, "occluded %u", &at) == 1 && at < known && scene) {
            printf("time %.9f\n", time_occluded(scene, &sets[at]));
        } else if (sscanf(line, "hits %u %4095[^\n]", &at, name) == 2 && at < known && scene) {
            write_hits(scene, &sets[at], name);
            printf("written\n");
        } else {
            fail("not understood:", line);
        }
        fflush(stdout);
    }
    return 0;
}
