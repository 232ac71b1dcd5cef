/*
 * Selvedge: decoder of compressed measured materials (bidirectional texture functions).
 *
 * The same file gives the same bits on every machine. `selvedge_open` checks every rule of the format once;
 * what it opened can then be sampled, and nothing about the file can fail any more.
 *
 * Memory. The library allocates nothing, keeps no state and needs no initialisation. The caller lends all memory:
 * the file's bytes, the material, results and scratch. Nothing has to be released.
 *
 * Lifetime. A material holds pointers to the bytes it was opened with, and to the bytes of its dictionary. They must
 * stay where they are, unchanged, for as long as the material or a copy of it is used.
 *
 * Threads. Every function may be called from any thread at any time. Any number of threads may use one material at
 * once, since it is only read; each needs results and scratch of its own.
 *
 * Errors. A function that can fail returns a status. A call that failed has written nothing to its results but what
 * its description says; lent buffers may hold anything afterwards. Pointers must not be NULL, except where that
 * is said, and must be aligned for their type; a pointer with a length of 0 may be NULL. NULL, misaligned pointers,
 * short buffers, lengths beyond the address space and materials that are not open give a status. So does memory
 * which is written by opening, images and batches if it overlaps the files or other memory of the same call.
 * That memory is there for the stated length is the caller's word.
 *
 * Numbers. `_q15` and the like say how many fraction bits an integer has: 1 is 32768 in Q15. `_q32` of a position
 * is a fraction of the image, 0 to 2^32 - 1, so that positions wrap by themselves. Indices and levels beyond the
 * end are moved to the last. No argument is so wrong that a sample fails: parts of directions beyond their ranges are
 * moved to their ends.
 *
 * C99 or later, C++98 with <stdint.h> or later. Licence: MIT or Apache-2.0, at your choice.
 */
#ifndef SELVEDGE_H
#define SELVEDGE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Version of the interface that this header describes; compare with selvedge_abi_version(). */
#define SELVEDGE_ABI_VERSION 2
/* 64-bit words of a material. */
#define SELVEDGE_MATERIAL_WORDS 64
/* Bytes of a decode digest. */
#define SELVEDGE_DIGEST_LENGTH 32
/* Most queries of one batch: 2^28 - 1. */
#define SELVEDGE_BATCH_LIMIT 268435455

/* What a function has to say. 0 to 5 are the exit codes of the program `selvedge`; 2 is left for input and output. */
typedef int32_t selvedge_status;

#define SELVEDGE_OK 0
/* The dictionary is missing, unwanted, or not the one that the material names. */
#define SELVEDGE_USAGE 1
/* The file breaks the format. */
#define SELVEDGE_INVALID 3
/* The file asks for more than the limits allow. */
#define SELVEDGE_LIMITS 4
/* The file is not known to be wrong, but this library cannot read it. */
#define SELVEDGE_UNSUPPORTED 5

/* Mistakes of the calling program. */

/* A pointer is NULL that may not be. */
#define SELVEDGE_NULL_POINTER 16
/* A pointer is not aligned for its type. */
#define SELVEDGE_MISALIGNED 17
/* The material was not opened: its memory is zero, was refused, or was copied in part. */
#define SELVEDGE_NOT_OPEN 18
/* A lent buffer has fewer elements than are needed. */
#define SELVEDGE_TOO_SHORT 19
/* A length is larger than any memory, or a batch has more than SELVEDGE_BATCH_LIMIT queries. */
#define SELVEDGE_TOO_LONG 20
/* Memory to be written overlaps a file or other memory of the call. */
#define SELVEDGE_OVERLAP 21
/* There is no rule of this number. */
#define SELVEDGE_NO_RULE 22

/* Which of the two files a finding is about. */
#define SELVEDGE_PART_FILE 0
#define SELVEDGE_PART_DICTIONARY 1

/* States of a channel: its values are zero; a mean for each pair of directions; a mean and texture. */
#define SELVEDGE_CHANNEL_MISSING 0
#define SELVEDGE_CHANNEL_MEAN 1
#define SELVEDGE_CHANNEL_FULL 2

/* What channels are: base-two logarithms of radiance plus an offset, or linear. */
#define SELVEDGE_TRANSFER_LOG2 0
#define SELVEDGE_TRANSFER_LINEAR 1

/* One: of cosines and weights, of points, of channel values. */
#define SELVEDGE_ONE_Q15 32768
#define SELVEDGE_ONE_Q18 262144
#define SELVEDGE_ONE_Q20 1048576

/*
 * An open material, in memory of the caller: on the stack, in a structure, anywhere that is aligned for uint64_t.
 * Its words are the library's business. It may be copied by assignment or memcpy; copies are as good as it is.
 * Set it to zero where it is declared, and when its bytes are given back: such a material is refused with
 * SELVEDGE_NOT_OPEN. Memory that happens to hold an old material cannot be told from an open one.
 */
typedef struct selvedge_material {
    uint64_t opaque[SELVEDGE_MATERIAL_WORDS];
} selvedge_material;

/* What the caller is willing to spend. A file beyond it is refused by its header, before its payload is read. */
typedef struct selvedge_limits {
    uint32_t bytes;      /* of the file, and of the dictionary */
    uint32_t operations; /* 32-bit multiplications of a filtered sample, at worst; between two levels twice as many */
    uint32_t texels;     /* of the full resolution */
} selvedge_limits;

/* A broken rule: which, where, and what was found there. */
typedef struct selvedge_finding {
    uint32_t rule;   /* 1 to selvedge_rule_count(), or 0 for no finding; other releases may number otherwise, so store the id */
    uint32_t part;   /* SELVEDGE_PART_FILE or SELVEDGE_PART_DICTIONARY */
    uint32_t offset; /* bytes from the start of that file */
    uint32_t found;  /* what stands there, or the length that was found */
} selvedge_finding;

/* The fields of a material's header; chapter 3.1 of the specification. */
typedef struct selvedge_header {
    uint32_t minor_version;
    uint32_t file_length; /* bytes */
    uint32_t content;     /* 0: a material */
    uint32_t method;      /* number of the method; chapter 3.1 of the specification */
    uint32_t section_count;
    uint32_t operations;         /* 32-bit multiplications of a filtered sample, at worst */
    uint32_t width;              /* texels along x, 1 to 16384 */
    uint32_t height;             /* texels along y, 1 to 16384 */
    uint32_t light_count;        /* sample directions of the light, 1 to 1024 */
    uint32_t view_count;         /* sample directions of the view, 1 to 1024 */
    uint32_t level_count;        /* levels of detail, 1 to 15; 1: the full resolution alone */
    uint32_t edge;               /* texels along the side of a block, 1 to 16 */
    uint32_t layer_count;        /* quality layers, 1 to 8 */
    uint32_t states[3];          /* SELVEDGE_CHANNEL_*, of each channel */
    uint32_t transfer;           /* SELVEDGE_TRANSFER_* */
    uint32_t cosine_included;    /* 1 if the light's cosine is in the values, else 0 */
    uint32_t transfer_parameter; /* binary32 bits of the log offset, or the linear exponent as a signed number */
    int32_t matrix_q13[9];       /* rows: red, green, blue; columns: channels 0, 1, 2 */
} selvedge_header;

/* UTF-8 within the file's bytes, without control characters and WITHOUT A NUL at its end. Never NULL. */
typedef struct selvedge_text {
    const char *text;
    size_t length; /* bytes, may be 0 */
} selvedge_text;

/* What a person or a renderer wants to know beside the values. */
typedef struct selvedge_metadata {
    uint32_t texel_width_nm;  /* nanometres, 0 if unknown */
    uint32_t texel_height_nm; /* nanometres, 0 if unknown */
    uint32_t frame;           /* axes of directions: 0 unknown, 1 x right and y up in the image, 2 x right and y down */
    uint32_t image_origin;    /* where texel (0, 0) is: 0 unknown, 1 top left, 2 bottom left */
    uint32_t primaries;       /* 0 unknown, 1 Rec. 709, 2 Rec. 2020, 3 CIE XYZ, 4 the camera's */
    selvedge_text name;       /* of the material */
    selvedge_text origin;     /* where the data are from */
    selvedge_text licence;    /* under which terms they are given */
} selvedge_metadata;

/*
 * A direction in the material's tangent frame: the stereographic projection of a unit vector (x, y, z), whose z is
 * along the surface normal. Fill it in, or let selvedge_direction_from_vector do it.
 */
typedef struct selvedge_direction {
    int32_t x_q18; /* x / (1 + z), -SELVEDGE_ONE_Q18 to SELVEDGE_ONE_Q18 */
    int32_t y_q18; /* y / (1 + z), the same */
    int32_t z_q15; /* z, 0 at and below the horizon to SELVEDGE_ONE_Q15 */
} selvedge_direction;

/* Three sample directions and their weights. */
typedef struct selvedge_taps {
    uint32_t a;
    uint32_t b;
    uint32_t c;
    int32_t weight_a_q15; /* the weights sum to SELVEDGE_ONE_Q15 */
    int32_t weight_b_q15;
    int32_t weight_c_q15;
    int32_t cosine_q15; /* cosine asked for over cosine sampled: one within the hull of the samples, less beyond */
} selvedge_taps;

/* A direction located among the sample directions of a material. Locate once, use for many texels. */
typedef struct selvedge_located {
    selvedge_direction direction; /* the direction asked for, every part clamped to its range */
    int32_t clamped_x_q18;        /* its point, moved onto the hull of the samples where it lies beyond */
    int32_t clamped_y_q18;
    selvedge_taps taps;
} selvedge_located;

/* Values of the three channels, Q20: -2^27 to 2^27. */
typedef struct selvedge_values {
    int32_t c0; /* luminance in most files */
    int32_t c1;
    int32_t c2;
} selvedge_values;

/* Linear radiance as three binary32 bit patterns: never negative, never infinite, never NaN. */
typedef struct selvedge_rgb {
    uint32_t r;
    uint32_t g;
    uint32_t b;
} selvedge_rgb;

/* A filtered sample to be made. */
typedef struct selvedge_query {
    uint32_t u_q32; /* fraction of the image along x */
    uint32_t v_q32; /* fraction of the image along y */
    selvedge_direction light;
    selvedge_direction view;
} selvedge_query;

/*
 * Receives a finding of selvedge_validate, with the context that was given there. The finding is only valid during the
 * call. Returns anything but 0 to go on, 0 to end the validation. It must return: an exception of C++ that leaves it
 * ends the program (in a library for firmware it is undefined), and longjmp out of it is undefined.
 */
typedef int32_t (*selvedge_report)(void *context, const selvedge_finding *finding);

/* ---- The library ---- */

/* SELVEDGE_ABI_VERSION of the library. Another number is another interface: do not call the rest. */
uint32_t selvedge_abi_version(void);

/* Size and alignment of a material in bytes, for languages that cannot read this header. */
size_t selvedge_material_size(void);
size_t selvedge_material_alignment(void);

/* What a status means, in English: a constant, NUL-terminated string. Never NULL. */
const char *selvedge_status_text(selvedge_status status);

/* ---- Opening ---- */

/* The limits that apply where none are given: 256 MiB, a million operations, 64 Mi texels. */
selvedge_status selvedge_default_limits(selvedge_limits *out);

/*
 * Opens a material: checks every rule of the format. The time is proportional to the length of the file.
 *
 * bytes, length: the whole file. It need not be aligned. NULL with length 0 is an empty file.
 * dictionary, dictionary_length: the file of the external dictionary, or NULL where there is none.
 * limits: NULL for the default ones.
 * out_material: becomes the open material; after a failure it is not open, unless it could not be written because it
 *     is NULL, misaligned or overlaps what is read.
 * out_finding: NULL, or what receives the first broken rule; its rule is 0 if there is none. It is written if the
 *     files were looked at: status 0 to 5.
 *
 * Gives SELVEDGE_OK; SELVEDGE_INVALID, _UNSUPPORTED, _LIMITS or _USAGE by the family of the first broken rule; or
 * SELVEDGE_NULL_POINTER, _MISALIGNED, _TOO_LONG, _OVERLAP.
 */
selvedge_status selvedge_open(const uint8_t *bytes, size_t length, const uint8_t *dictionary, size_t dictionary_length, const selvedge_limits *limits,
                              selvedge_material *out_material, selvedge_finding *out_finding);

/*
 * Checks a file, a material or a dictionary, and tells every finding as far as later parts can still be found.
 *
 * Arguments as for selvedge_open. report may be NULL; the check then ends at the first finding. context is handed to
 * report and not looked at.
 *
 * Gives SELVEDGE_OK if there is no finding, else as selvedge_open by the family of the first.
 */
selvedge_status selvedge_validate(const uint8_t *bytes, size_t length, const uint8_t *dictionary, size_t dictionary_length,
                                  const selvedge_limits *limits, selvedge_report report, void *context);

/* Rules that this library checks: their numbers are 1 to this. */
uint32_t selvedge_rule_count(void);

/*
 * What a rule is: its number in the specification such as "3.1-1", its name in the conformance table, and what it asks
 * for in a few words. Constant, NUL-terminated ASCII strings; empty for 0 and for numbers without a rule. Never NULL.
 */
const char *selvedge_rule_id(uint32_t rule);
const char *selvedge_rule_name(uint32_t rule);
const char *selvedge_rule_title(uint32_t rule);

/* The status of a file that breaks a rule; SELVEDGE_NO_RULE if there is no such rule. */
selvedge_status selvedge_rule_family(uint32_t rule);

/* ---- An open material ----
 *
 * All of these give SELVEDGE_OK, or SELVEDGE_NULL_POINTER, _MISALIGNED or _NOT_OPEN, and write `out` only if all is
 * well. What they read may be given back when they return. `out` may be what is read: all is read before.
 */

/* The header's fields. */
selvedge_status selvedge_read_header(const selvedge_material *material, selvedge_header *out);

/* The metadata. Its texts point into the file's bytes and last as long as those. */
selvedge_status selvedge_read_metadata(const selvedge_material *material, selvedge_metadata *out);

/*
 * The same material decoded only up to a quality layer, 1 for the first alone; 0 is 1, and more than there are is all of
 * them. It refers to the same bytes.
 */
selvedge_status selvedge_with_layers(const selvedge_material *material, uint32_t layers, selvedge_material *out);

/* ---- Directions and positions ---- */

/*
 * The direction of a unit vector: three floats x, y, z in the tangent frame. Integer arithmetic on their bits, so every
 * machine gives the same; magnitudes beyond one, infinities and NaN count as one.
 */
selvedge_status selvedge_direction_from_vector(const float *vector, selvedge_direction *out);

/* The same from binary32 bit patterns, for machines without floats. */
selvedge_status selvedge_direction_from_bits(uint32_t x_bits, uint32_t y_bits, uint32_t z_bits, selvedge_direction *out);

/* The fraction of a position of any magnitude, given as binary32 bits: 1.25 and -0.75 are both 0x40000000. */
uint32_t selvedge_position_from_bits(uint32_t position_bits);

/* A query from two floats of position, which wrap, and two unit vectors of three floats. */
selvedge_status selvedge_query_from_floats(const float *position, const float *light, const float *view, selvedge_query *out);

/* A sample direction of the light, or of the view. */
selvedge_status selvedge_light_direction(const selvedge_material *material, uint32_t index, selvedge_direction *out);
selvedge_status selvedge_view_direction(const selvedge_material *material, uint32_t index, selvedge_direction *out);

/* Locates a direction among the sample directions of the light, or of the view. */
selvedge_status selvedge_locate_light(const selvedge_material *material, const selvedge_direction *direction, selvedge_located *out);
selvedge_status selvedge_locate_view(const selvedge_material *material, const selvedge_direction *direction, selvedge_located *out);

/* ---- Samples: linear radiance ---- */

/* One texel of the full resolution for one pair of sample directions; nothing is interpolated. */
selvedge_status selvedge_sample_point(const selvedge_material *material, uint32_t texel_x, uint32_t texel_y, uint32_t light_index,
                                      uint32_t view_index, selvedge_rgb *out);

/* One texel of the full resolution for any directions. */
selvedge_status selvedge_sample_texel(const selvedge_material *material, uint32_t texel_x, uint32_t texel_y, const selvedge_direction *light,
                                      const selvedge_direction *view, selvedge_rgb *out);

/* Any position of the full resolution, between texels, for any directions. */
selvedge_status selvedge_sample_filtered(const selvedge_material *material, uint32_t u_q32, uint32_t v_q32, const selvedge_direction *light,
                                         const selvedge_direction *view, selvedge_rgb *out);

/* The same between two levels of detail. The level is in Q16: 0x18000 is 1.5. */
selvedge_status selvedge_sample_trilinear(const selvedge_material *material, uint32_t level_q16, uint32_t u_q32, uint32_t v_q32,
                                          const selvedge_direction *light, const selvedge_direction *view, selvedge_rgb *out);

/* ---- Samples: channel values, before colour and transfer ----
 *
 * Located directions are those that selvedge_locate_light and selvedge_locate_view give of the same material; any others are safe, and
 * give values without meaning.
 */

selvedge_status selvedge_point_values(const selvedge_material *material, uint32_t texel_x, uint32_t texel_y, uint32_t light_index,
                                      uint32_t view_index, selvedge_values *out);
selvedge_status selvedge_texel_values(const selvedge_material *material, uint32_t texel_x, uint32_t texel_y, const selvedge_located *light,
                                      const selvedge_located *view, selvedge_values *out);
selvedge_status selvedge_filtered_values(const selvedge_material *material, uint32_t u_q32, uint32_t v_q32, const selvedge_located *light,
                                         const selvedge_located *view, selvedge_values *out);
selvedge_status selvedge_trilinear_values(const selvedge_material *material, uint32_t level_q16, uint32_t u_q32, uint32_t v_q32,
                                          const selvedge_located *light, const selvedge_located *view, selvedge_values *out);

/* Channel values to linear radiance under a located light. */
selvedge_status selvedge_radiance(const selvedge_material *material, const selvedge_values *values, const selvedge_located *light, selvedge_rgb *out);

/* ---- Many at once: the same bits, faster ----
 *
 * Lengths count elements, not bytes. Scratch needs no particular contents and keeps none. Beside the statuses above these give
 * SELVEDGE_TOO_SHORT, _TOO_LONG and _OVERLAP. Elements of `out` beyond the results are not touched.
 */

/* Texels of a level along x and y. */
selvedge_status selvedge_image_size(const selvedge_material *material, uint32_t level, uint32_t *out_width, uint32_t *out_height);

/* Elements of scratch that an image needs: the same for every level, channel and direction. */
selvedge_status selvedge_image_scratch_length(const selvedge_material *material, size_t *out);

/*
 * Linear radiance of every texel of a level for one light and one view, row by row from texel (0, 0).
 * out_length is at least width times height of the level.
 */
selvedge_status selvedge_decode_image(const selvedge_material *material, uint32_t level, const selvedge_direction *light,
                                      const selvedge_direction *view, int32_t *scratch, size_t scratch_length, selvedge_rgb *out,
                                      size_t out_length);

/* The same for the values of one channel, Q20; a channel beyond 2 is 2. */
selvedge_status selvedge_decode_channel(const selvedge_material *material, uint32_t channel, uint32_t level, const selvedge_direction *light,
                                        const selvedge_direction *view, int32_t *scratch, size_t scratch_length, int32_t *out,
                                        size_t out_length);

/* Elements of scratch that a batch of `count` queries needs. */
selvedge_status selvedge_batch_scratch_length(const selvedge_material *material, size_t count, size_t *out);

/*
 * Filtered samples: out[i] is what selvedge_sample_filtered gives of queries[i]. Tens of thousands are a good batch.
 * out_length is at least count.
 */
selvedge_status selvedge_sample_batch(const selvedge_material *material, const selvedge_query *queries, size_t count, int32_t *scratch,
                                      size_t scratch_length, selvedge_rgb *out, size_t out_length);

/*
 * Radiances as floats: r, g, b of each, a copy of their bits. `out` may be the memory of `texels`. out_length is at least
 * three times count. Gives SELVEDGE_OK, SELVEDGE_NULL_POINTER, _MISALIGNED, _TOO_SHORT or _TOO_LONG.
 */
selvedge_status selvedge_to_floats(const selvedge_rgb *texels, size_t count, float *out, size_t out_length);

/* ---- Conformance ---- */

/*
 * SHA-256 of what a fixed sequence of queries decodes to, SELVEDGE_DIGEST_LENGTH bytes: equal for every right decoder.
 * It costs some 800 samples.
 */
selvedge_status selvedge_decode_digest(const selvedge_material *material, uint8_t *out);

#ifdef __cplusplus
}
#endif

#endif
