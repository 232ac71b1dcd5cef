/*
 * Opens a material, prints what it is, a few samples and its decode digest, and renders a picture of it.
 *
 *     sample FILE [DICTIONARY or -] [PICTURE.ppm]
 *
 * Exit codes are those of the program `selvedge`: 0 good, 1 bad usage, 2 I/O, 3 invalid file, 4 over the limits,
 * 5 unsupported.
 */
#include "selvedge.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define BAD_USAGE 1
#define BAD_IO 2

/* A file in memory. */
struct file {
    uint8_t *bytes;
    size_t length;
};

/* Reads a whole file; 0 if that went well. */
static int read_file(const char *path, struct file *file)
{
    FILE *stream = fopen(path, "rb");
    size_t room = 0;
    file->bytes = NULL;
    file->length = 0;
    if (stream == NULL) {
        perror(path);
        return BAD_IO;
    }
    for (;;) {
        size_t count;
        if (file->length == room) {
            uint8_t *larger = (uint8_t *)realloc(file->bytes, room = room * 2 + 65536);
            if (larger == NULL) {
                break;
            }
            file->bytes = larger;
        }
        count = fread(file->bytes + file->length, 1, room - file->length, stream);
        file->length += count;
        if (count == 0) {
            break;
        }
    }
    if (ferror(stream) || !feof(stream)) {
        fprintf(stderr, "%s: cannot be read\n", path);
        fclose(stream);
        return BAD_IO;
    }
    fclose(stream);
    return 0;
}

/* Tells why a call failed; gives the exit code. */
static int tell(selvedge_status status, const char *what)
{
    fprintf(stderr, "%s: %s\n", what, selvedge_status_text(status));
    return status < SELVEDGE_NULL_POINTER ? (int)status : BAD_USAGE;
}

/* Tells which rule a file breaks, where, and what was found there. */
static void tell_finding(const char *path, const selvedge_finding *finding)
{
    fprintf(stderr, "%s: %s%s at byte %lu: %s; found %lu (0x%lx)\n", path, finding->part == SELVEDGE_PART_DICTIONARY ? "dictionary: " : "",
            selvedge_rule_id(finding->rule), (unsigned long)finding->offset, selvedge_rule_title(finding->rule), (unsigned long)finding->found,
            (unsigned long)finding->found);
}

static void print_text(const char *label, selvedge_text text)
{
    printf("%s: ", label);
    fwrite(text.text, 1, text.length, stdout);
    putchar('\n');
}

static void print_rgb(const char *label, selvedge_rgb rgb)
{
    printf("%s: %08lx %08lx %08lx\n", label, (unsigned long)rgb.r, (unsigned long)rgb.g, (unsigned long)rgb.b);
}

/* A few samples of each kind, as bits: they are equal on every machine. */
static selvedge_status print_samples(const selvedge_material *material)
{
    static const float lights[3][3] = {{0.0f, 0.0f, 1.0f}, {0.6f, 0.0f, 0.8f}, {-0.28f, 0.96f, 0.0f}};
    static const float views[3][3] = {{0.0f, 0.6f, 0.8f}, {0.0f, 0.0f, 1.0f}, {-0.48f, -0.36f, 0.8f}};
    uint32_t n;
    for (n = 0; n < 3; n++) {
        selvedge_direction light, view;
        selvedge_rgb rgb;
        selvedge_status status;
        /* Unsigned, so that positions wrap as they should. */
        uint32_t u_q32 = 0x12345678u + n * 0x50000000u;
        uint32_t v_q32 = 0x0fedcba9u + n * 0x70000000u;
        status = selvedge_sample_point(material, n * 7, n * 11, n * 13, n * 17, &rgb);
        if (status != SELVEDGE_OK) {
            return status;
        }
        print_rgb("point", rgb);
        if ((status = selvedge_direction_from_vector(lights[n], &light)) != SELVEDGE_OK ||
            (status = selvedge_direction_from_vector(views[n], &view)) != SELVEDGE_OK ||
            (status = selvedge_sample_filtered(material, u_q32, v_q32, &light, &view, &rgb)) != SELVEDGE_OK) {
            return status;
        }
        print_rgb("filtered", rgb);
        status = selvedge_sample_trilinear(material, n * 0x8000u, u_q32, v_q32, &light, &view, &rgb);
        if (status != SELVEDGE_OK) {
            return status;
        }
        print_rgb("trilinear", rgb);
    }
    return SELVEDGE_OK;
}

/* A byte of a picture: square roots stand for the curve of a screen, and are the same everywhere. */
static int to_byte(float radiance)
{
    float shown = sqrtf(radiance);
    return shown < 1.0f ? (int)(shown * 255.0f + 0.5f) : 255;
}

/* Renders the largest level of at most 256 x 256 texels, lit from the right and seen from above. */
static int render(const selvedge_material *material, uint32_t level_count, const char *path)
{
    static const float right[3] = {0.6f, 0.0f, 0.8f};
    static const float above[3] = {0.0f, 0.0f, 1.0f};
    selvedge_direction light, view;
    selvedge_status status;
    selvedge_rgb *texels = NULL;
    int32_t *scratch = NULL;
    float *floats = NULL;
    size_t scratch_length = 0, count, n;
    uint32_t level = 0, width, height;
    int result = BAD_IO;
    FILE *stream = NULL;

    for (;;) {
        status = selvedge_image_size(material, level, &width, &height);
        if (status != SELVEDGE_OK) {
            return tell(status, "image size");
        }
        if ((width <= 256 && height <= 256) || level + 1 >= level_count) {
            break;
        }
        level++;
    }
    if ((status = selvedge_direction_from_vector(right, &light)) != SELVEDGE_OK ||
        (status = selvedge_direction_from_vector(above, &view)) != SELVEDGE_OK ||
        (status = selvedge_image_scratch_length(material, &scratch_length)) != SELVEDGE_OK) {
        return tell(status, "image");
    }
    count = (size_t)width * height;
    /* One more, since no element at all may give NULL. */
    scratch = (int32_t *)malloc((scratch_length + 1) * sizeof *scratch);
    texels = (selvedge_rgb *)malloc(count * sizeof *texels);
    floats = (float *)malloc(count * 3 * sizeof *floats);
    if (scratch == NULL || texels == NULL || floats == NULL) {
        fprintf(stderr, "%s: no memory\n", path);
        goto done;
    }
    if ((status = selvedge_decode_image(material, level, &light, &view, scratch, scratch_length, texels, count)) != SELVEDGE_OK ||
        (status = selvedge_to_floats(texels, count, floats, count * 3)) != SELVEDGE_OK) {
        result = tell(status, "image");
        goto done;
    }
    stream = fopen(path, "wb");
    if (stream == NULL) {
        perror(path);
        goto done;
    }
    fprintf(stream, "P6\n%lu %lu\n255\n", (unsigned long)width, (unsigned long)height);
    for (n = 0; n < count * 3; n++) {
        putc(to_byte(floats[n]), stream);
    }
    result = ferror(stream) ? BAD_IO : 0;
    if (fclose(stream) != 0) {
        result = BAD_IO;
    }
    if (result != 0) {
        fprintf(stderr, "%s: cannot be written\n", path);
    }
done:
    free(floats);
    free(texels);
    free(scratch);
    return result;
}

/* Everything that is done with an open material. */
static int show(const selvedge_material *material, const char *picture)
{
    selvedge_header header;
    selvedge_metadata metadata;
    selvedge_status status;
    uint8_t digest[SELVEDGE_DIGEST_LENGTH];
    size_t n;

    if ((status = selvedge_read_header(material, &header)) != SELVEDGE_OK ||
        (status = selvedge_read_metadata(material, &metadata)) != SELVEDGE_OK) {
        return tell(status, "material");
    }
    print_text("name", metadata.name);
    printf("texels: %lu x %lu\n", (unsigned long)header.width, (unsigned long)header.height);
    printf("directions: %lu light, %lu view\n", (unsigned long)header.light_count, (unsigned long)header.view_count);
    if ((status = print_samples(material)) != SELVEDGE_OK) {
        return tell(status, "samples");
    }
    if ((status = selvedge_decode_digest(material, digest)) != SELVEDGE_OK) {
        return tell(status, "digest");
    }
    printf("digest: ");
    for (n = 0; n < sizeof digest; n++) {
        printf("%02x", digest[n]);
    }
    putchar('\n');
    return picture == NULL ? 0 : render(material, header.level_count, picture);
}

int main(int argc, char **argv)
{
    selvedge_material material = {{0}};
    selvedge_finding finding;
    struct file file = {NULL, 0}, dictionary = {NULL, 0};
    selvedge_status status;
    int result;

    if (argc < 2 || argc > 4) {
        fprintf(stderr, "usage: sample FILE [DICTIONARY or -] [PICTURE.ppm]\n");
        return BAD_USAGE;
    }
    if (selvedge_abi_version() != SELVEDGE_ABI_VERSION) {
        fprintf(stderr, "sample: the library has another interface\n");
        return BAD_USAGE;
    }
    result = read_file(argv[1], &file);
    if (result == 0 && argc > 2 && strcmp(argv[2], "-") != 0) {
        result = read_file(argv[2], &dictionary);
    }
    if (result == 0) {
        status = selvedge_open(file.bytes, file.length, dictionary.bytes, dictionary.length, NULL, &material, &finding);
        if (status == SELVEDGE_OK) {
            result = show(&material, argc > 3 ? argv[3] : NULL);
        } else if (status < SELVEDGE_NULL_POINTER) {
            tell_finding(argv[1], &finding);
            result = (int)status;
        } else {
            result = tell(status, argv[1]);
        }
    }
    /* The material goes with the bytes that it refers to. */
    memset(&material, 0, sizeof material);
    free(dictionary.bytes);
    free(file.bytes);
    return result;
}
