/* Labels a part in C: which places of its surface a flat end cannot reach.
 *
 * `label` labels a block of 40 x 30 x 20 mm and compares with the answer computed by hand; `label PART.stl [FOLDER]`
 * labels a file and writes the folder of `deepmill label`. docs/c.md says how to build it.
 */
#include "deepmill.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Ends the program if a call has failed. */
static void require(dm_context *context, dm_status status, const char *call)
{
    char text[1000] = "";
    if (status == DM_OK) {
        return;
    }
    if (dm_error_text(context, text, sizeof text, NULL) != DM_OK) {
        fprintf(stderr, "%s: %s\n", call, dm_status_text(status));
    } else {
        fprintf(stderr, "%s: %s\n", call, text);
    }
    dm_context_free(&context);
    exit(EXIT_FAILURE);
}

#define REQUIRE(call) require(context, call, #call)

static int progress(void *user, uint32_t stage, size_t done, size_t of)
{
    int *n_calls = user;
    *n_calls += 1;
    printf("stage %u: %zu of %zu\n", (unsigned)stage, done, of);
    return 0; /* another number stops */
}

/* The corners of the block, and twelve triangles, counter-clockwise seen from outside. */
static const double corners[8][3] = {
    {0, 0, 0}, {40, 0, 0}, {40, 30, 0}, {0, 30, 0}, {0, 0, 20}, {40, 0, 20}, {40, 30, 20}, {0, 30, 20},
};
static const uint32_t triangles[12][3] = {
    {0, 2, 1}, {0, 3, 2}, {4, 5, 6}, {4, 6, 7}, {0, 1, 5}, {0, 5, 4},
    {1, 2, 6}, {1, 6, 5}, {2, 3, 7}, {2, 7, 6}, {3, 0, 4}, {3, 4, 7},
};

/* The holder begins 11 mm above the tip: from above the tool reaches walls of 20 mm from a height of 9 mm on, and not
 * the underside. Returns the number of wrong answers. */
static size_t compare(const float *points, const uint8_t *answers, size_t n_sites)
{
    size_t n_wrong = 0;
    for (size_t i = 0; i < n_sites; i++) {
        float z = points[3 * i + 2];
        int is_reached = answers[i] == DM_ACCESSIBLE;
        /* Within the tolerance of 0.01 mm either answer is right. */
        if (fabsf(z - 9) > 0.02f && is_reached != (z > 9)) {
            n_wrong++;
        }
    }
    return n_wrong;
}

int main(int n_arguments, char **arguments)
{
    dm_handle mesh, tools, analysis, outcome;
    size_t n_sites, n_findings, n_wrong = 0;
    int n_calls = 0;
    double share, mm2;
    dm_context *context = dm_context_new(DM_ABI_VERSION);
    if (context == NULL) {
        fprintf(stderr, "the library has ABI version %u, the header %u\n", (unsigned)dm_abi_version(),
                (unsigned)DM_ABI_VERSION);
        return EXIT_FAILURE;
    }

    if (n_arguments > 1) {
        REQUIRE(dm_mesh_read(context, arguments[1], NULL, 0, &mesh));
    } else {
        REQUIRE(dm_mesh_new(context, corners[0], 8, triangles[0], 12, NULL, 0, &mesh));
    }
    REQUIRE(dm_tools_new(context, &tools));
    REQUIRE(dm_tools_add_flat_end(context, tools, 3, 5, 20, 20, 0)); /* CR, CH, FR, FH, clearance */
    REQUIRE(dm_analysis_new(context, mesh, tools, &analysis));
    REQUIRE(dm_analysis_set_sites(context, analysis, 2000, 0));
    REQUIRE(dm_analysis_set_directions(context, analysis, "up"));
    REQUIRE(dm_analysis_set_search(context, analysis, 0));
    REQUIRE(dm_analysis_run(context, analysis, progress, &n_calls, &outcome));

    REQUIRE(dm_outcome_counts(context, outcome, &n_sites, NULL, NULL));
    REQUIRE(dm_outcome_share(context, outcome, 0, DM_INACCESSIBLE, &share));
    REQUIRE(dm_outcome_surface(context, outcome, &mm2));
    printf("%zu sites, %.1f %% of %.0f mm2 out of reach\n", n_sites, 100 * share, mm2);
    REQUIRE(dm_outcome_n_findings(context, outcome, 0, &n_findings));
    for (size_t i = 0; i < n_findings; i++) {
        dm_finding finding;
        REQUIRE(dm_outcome_finding(context, outcome, 0, i, &finding));
        printf("%.0f mm2 at (%.1f, %.1f, %.1f)\n", finding.area_mm2, finding.at_mm[0], finding.at_mm[1],
               finding.at_mm[2]);
    }

    if (n_arguments > 2) {
        REQUIRE(dm_outcome_write(context, outcome, arguments[2], NULL, DM_WRITE_REPORT, NULL, NULL));
    }
    if (n_arguments == 1) {
        float *points = malloc(3 * n_sites * sizeof *points);
        uint8_t *answers = malloc(n_sites);
        if (points == NULL || answers == NULL) {
            abort();
        }
        REQUIRE(dm_outcome_floats(context, outcome, 0, DM_POINTS, points, 3 * n_sites, NULL));
        REQUIRE(dm_outcome_bytes(context, outcome, 0, DM_ANSWERS, answers, n_sites, NULL));
        n_wrong = compare(points, answers, n_sites);
        free(points);
        free(answers);
        printf("%zu answers differ from those computed by hand\n", n_wrong);
        /* The underside of 1200 mm2 and 9 of 20 mm of walls of 2800 mm2, of 5200 mm2. */
        if (fabs(share - 2460.0 / 5200.0) > 0.02 || n_calls == 0) {
            n_wrong++;
        }
    }
    dm_context_free(&context); /* and all that it holds */
    return n_wrong == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
