/* Stands in for Open Image Denoise in tests/denoise.rs: its C API, with a box filter of 7 by 7 pixels.
 * OLD gives two functions the names that version 1 has. STUB_FAILS makes the filter fail; STUB_WANTS_LAYERS
 * makes it fail without albedo and normal; STUB_SHOWS has it filter one of these instead of the picture. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

struct filter {
    const float *color, *albedo, *normal;
    float *output;
    size_t width, height;
    bool hdr, committed;
};

static char device;
static const char *error;

void *oidnNewDevice(int type) { return type == 1 ? &device : NULL; }
void oidnCommitDevice(void *at) { (void)at; }
void oidnReleaseDevice(void *at) { (void)at; }

int oidnGetDeviceError(void *at, const char **message) {
    const char *last = error;
    (void)at;
    error = NULL;
    *message = last;
    return last ? 1 : 0;
}

#ifdef OLD
int oidnGetDevice1i(void *at, const char *name) { return at && !strcmp(name, "version") ? 10403 : 0; }
#else
int oidnGetDeviceInt(void *at, const char *name) { return at && !strcmp(name, "version") ? 20301 : 0; }
#endif

void *oidnNewFilter(void *at, const char *type) {
    return at && !strcmp(type, "RT") ? calloc(1, sizeof(struct filter)) : NULL;
}

void oidnSetSharedFilterImage(struct filter *filter, const char *name, void *pixels, int format, size_t width,
                              size_t height, size_t offset, size_t pixel_stride, size_t row_stride) {
    if (format != 3 || offset || pixel_stride || row_stride) error = "expected packed triples of floats";
    filter->width = width;
    filter->height = height;
    if (!strcmp(name, "color")) filter->color = pixels;
    if (!strcmp(name, "albedo")) filter->albedo = pixels;
    if (!strcmp(name, "normal")) filter->normal = pixels;
    if (!strcmp(name, "output")) filter->output = pixels;
}

#ifdef OLD
void oidnSetFilter1b(struct filter *filter, const char *name, bool value) {
#else
void oidnSetFilterBool(struct filter *filter, const char *name, bool value) {
#endif
    if (!strcmp(name, "hdr")) filter->hdr = value;
}

void oidnCommitFilter(struct filter *filter) { filter->committed = true; }

void oidnExecuteFilter(struct filter *filter) {
    long width = (long)filter->width, height = (long)filter->height;
    if (!filter->committed || !filter->hdr || !filter->color || !filter->output) error = "half a filter";
    if (getenv("STUB_FAILS")) error = "out of luck";
    if (getenv("STUB_WANTS_LAYERS") && (!filter->albedo || !filter->normal)) error = "no layers";
    if (error) return;
    const char *shown = getenv("STUB_SHOWS");
    const float *picture = shown && !strcmp(shown, "normal") ? filter->normal
                           : shown                           ? filter->albedo
                                                             : filter->color;
    for (long at = 0; at < width * height * 3; at++) {
        long y = at / 3 / width, x = at / 3 % width, count = 0;
        float sum = 0;
        if (!isfinite(picture[at])) error = "a value that is not finite";
        for (long v = y - 3; v <= y + 3; v++) {
            for (long u = x - 3; u <= x + 3; u++) {
                if (u < 0 || v < 0 || u >= width || v >= height) continue;
                sum += picture[(v * width + u) * 3 + at % 3];
                count++;
            }
        }
        filter->output[at] = sum / (float)count;
    }
}

void oidnReleaseFilter(struct filter *filter) { free(filter); }
