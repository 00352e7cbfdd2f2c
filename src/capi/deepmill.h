/* Which parts of a surface a milling cutter cannot reach, and what is in its way: the C interface of deepmill.
 * This file is written by `cargo run --manifest-path .ci/header/Cargo.toml`: change the sources instead.
 * A context holds every object by a handle. A handle that was freed, is of another context or of an object of another
 * kind is refused by DM_BAD_HANDLE. Calls with one context may come from several threads.
 * Every function but the first few returns a status, and of a failure the context keeps the text. Lengths are mm.
 * Of every pointer the caller promises: it is null, or it leads to as much memory of its type as the lengths beside it
 * state, aligned, and nobody else writes there during the call. Texts are UTF-8 and end with a zero. A context is null,
 * or was made by dm_context_new and not freed since. Null where a value is needed is refused by DM_BAD_ARGUMENT.
 * Buffers: n counts elements, not bytes. `needed`, which may be null, is set to the number of elements of the result,
 * for text with its zero. With a null buffer and n = 0 a call only asks for that. A buffer that is too short stays as
 * it was (DM_SHORT_BUFFER); elements beyond the result do too. */

#ifndef DEEPMILL_H
#define DEEPMILL_H

#include <stddef.h>
#include <stdint.h>

// Sites are placed.
#define DM_STAGE_SITES 0

// Tools are labeled.
#define DM_STAGE_LABELS 1

// What tools leave is computed.
#define DM_STAGE_MACHINING 2

// Predictions are computed again.
#define DM_STAGE_VERIFYING 3

// Findings, and what would help.
#define DM_STAGE_FINDINGS 4

// Files are written.
#define DM_STAGE_WRITING 5

// Also mend small faults of the mesh.
#define DM_REPAIR 1

// Take a mesh that does not bound solids, with a notice.
#define DM_FORCE 2

// In place of the number of a tool: what no tool reaches.
#define DM_ALL_TOOLS 4294967295

// The answer for a site: the tool reaches it.
#define DM_ACCESSIBLE 0

// The answer for a site: in every direction what does not cut, or the flank, collides.
#define DM_INACCESSIBLE 1

// The answer for a site: in some direction only the tip penetrates the part, in none nothing does.
#define DM_TIP_DOES_NOT_FIT 2

// Also write `report.html`.
#define DM_WRITE_REPORT 1

// Draw no pictures.
#define DM_WRITE_NO_PICTURES 2

// Also write binary glTF.
#define DM_WRITE_GLB 4

// Also write a table of the sites.
#define DM_WRITE_CSV 8

// Positions of the sites, mm; float, rows of three. The same of every tool.
#define DM_POINTS 1

// Outward unit normals of the sites; float, rows of three. The same of every tool.
#define DM_NORMALS 2

// The directions that were tested, from tip to spindle; float, rows of three. The same of every tool.
#define DM_DIRECTIONS 3

// A direction in which the tool reaches the site, NaN where there is none; float, rows of three.
#define DM_WITNESS 4

// Share of the directions in which the tool reaches the site; float.
#define DM_ACCESSIBLE_SHARE 5

// How much the tool leaves, 0 where it reaches, mm; float, with dm_analysis_set_rest.
#define DM_REST_MM 6

// Volume of what is left about each site, mm³; float, with dm_analysis_set_rest.
#define DM_REST_VOLUME_MM3 7

// How far every height and radius of the tool may grow or must shrink, mm; float, with
// dm_analysis_set_clearance_limit.
#define DM_CLEARANCE_MM 8

// Share of the directions that was not proven closed, of sites out of reach; float. 0: proven.
#define DM_OPEN_DIRECTIONS 9

// Share of the surface about each site; double. They add up to 1. The same of every tool.
#define DM_AREA_SHARES 101

// Where the tip is with DM_WITNESS, mm, NaN where there is none; double, rows of three.
#define DM_TIP_MM 102

// Gouge tolerance at each site, mm; double.
#define DM_TOLERANCE_MM 103

// The triangle that each site lies on; uint32_t. The same of every tool.
#define DM_FACES 201

// Number of directions in which the tool reaches the site; uint32_t.
#define DM_ACCESSIBLE_DIRECTIONS 202

// Number of the finding that each site belongs to, from 1 on, 0 if to none; uint32_t.
#define DM_FINDING_OF_SITE 203

// DM_ACCESSIBLE, DM_INACCESSIBLE or DM_TIP_DOES_NOT_FIT; uint8_t.
#define DM_ANSWERS 301

// 1 if the site is among those most often in the way, else 0; uint8_t, with dm_analysis_set_occlusion.
#define DM_OCCLUSION 302

// Name of the tool for files and tables; text.
#define DM_TOOL_NAME 401

// The tool in words, without its name; text.
#define DM_TOOL_WORDS 402

// What may make the answers misleading, a line each; text.
#define DM_WARNINGS 403

// What was changed or left out, a line each; text. The same of every tool.
#define DM_NOTICES 404

// The findings with all that is known of them, as in findings.json; text.
#define DM_FINDINGS_JSON 405

// Name of the part; text. The same of every tool.
#define DM_PART_NAME 406

// Version of this interface: programs compiled with a header of the same number run with this library.
#define DM_ABI_VERSION 1

// What a call of the C interface returns.
enum dm_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // It is done.
  DM_OK = 0,
  // The context is null.
  DM_NO_CONTEXT = 1,
  // A handle names nothing: it was freed, is of another context, or of an object of another kind.
  DM_BAD_HANDLE = 2,
  // An argument is null or outside its domain.
  DM_BAD_ARGUMENT = 3,
  // The buffer is too short; nothing was written into it.
  DM_SHORT_BUFFER = 4,
  // The numbers were not computed: an option of the analysis was off.
  DM_NOT_COMPUTED = 5,
  // The callback stopped the work.
  DM_INTERRUPTED = 6,
  // The system refused to open or read a file.
  DM_CANNOT_READ = 7,
  // The system refused to write a file.
  DM_CANNOT_WRITE = 8,
  // The content of a file is not what its format demands.
  DM_BAD_FILE = 9,
  // A mesh cannot be used as it is.
  DM_BAD_GEOMETRY = 10,
  // The work needs more memory than is sensible.
  DM_TOO_LARGE = 11,
  // A computation left the finite numbers.
  DM_NOT_FINITE = 12,
  // Another failure; the text has more.
  DM_OTHER = 13,
  // The library failed: a fault of the library, to be reported.
  DM_PANIC = 14,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum dm_status dm_status;
#else
typedef int32_t dm_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Everything that a program has made, by handles, and the text of the last failure. Its calls may come from several
// threads; the text is that of the last failure of all.
typedef struct dm_context dm_context;

// Names an object of a context; 0 names none.
typedef uint64_t dm_handle;

// Is called with how far the work is: done of so many parts of a stage, DM_STAGE_SITES and so on; another result than
// 0 stops the work. It is called on the thread that called, and may call the library. It must return: no exception,
// no longjmp.
typedef int (*dm_progress)(void *user, uint32_t stage, size_t done, size_t of);

// A region out of reach. NaN is what was not computed.
typedef struct {
  // Number of its sites.
  uint64_t n_sites;
  // The site nearest to its mean place.
  uint32_t site;
  // DM_INACCESSIBLE or DM_TIP_DOES_NOT_FIT.
  uint32_t answer;
  // Estimated area, mm².
  double area_mm2;
  // That area as a share of the surface.
  double area_share;
  // Where its site is, mm.
  double at_mm[3];
  // Mean outward normal; zero if the normals cancel.
  double normal[3];
  // Least corner of the box about its sites, mm.
  double low_mm[3];
  // Greatest corner of that box, mm.
  double high_mm[3];
  // Least clearance of its sites, mm.
  double worst_clearance_mm;
  // Greatest rest of its sites, mm.
  double greatest_rest_mm;
  // Volume of what is left about its sites, mm³.
  double left_mm3;
} dm_finding;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The version of this interface: compare it with DM_ABI_VERSION of the header.
uint32_t dm_abi_version(void);

// The version of the library, such as "0.1.0".
const char *dm_version(void);

// A status in words, never null. The text of a failure is more: dm_error_text.
const char *dm_status_text(int32_t status);

// Makes a context, which holds every object. Pass DM_ABI_VERSION: of another version than the library's it is null.
dm_context *dm_context_new(uint32_t abi_version);

// Frees a context with all of its objects, and sets the variable to null. A null variable stays as it is. No call with
// this context may be running.
void dm_context_free(dm_context **context);

// Copies the text of the last failure of this context: what was found, what is right, what to do. At first none.
dm_status dm_error_text(dm_context *context, char *buffer, size_t n, size_t *needed);

// Frees an object; 0 is none. What was made of it stays: an analysis holds its mesh and its tools.
dm_status dm_free(dm_context *context, dm_handle handle);

// Makes a mesh of arrays and prepares it as the commands do: near corners are joined, a mesh that faces inward is
// turned, bodies that overlap are joined; what does not bound solids is refused.
//
// vertices: rows of x, y, z. triangles: rows of three vertices from 0 on, counter-clockwise seen from outside.
// unit: "mm", "cm", "m" or "in", of the vertices; null is mm. flags: 0, or DM_REPAIR and DM_FORCE.
dm_status dm_mesh_new(dm_context *context,
                      const double *vertices,
                      size_t n_vertices,
                      const uint32_t *triangles,
                      size_t n_triangles,
                      const char *unit,
                      uint32_t flags,
                      dm_handle *mesh);

// Reads a mesh of a file, STL, OBJ, PLY or 3MF, and prepares it as dm_mesh_new.
//
// unit: that of the file's numbers; null is mm, or as a 3MF states.
dm_status dm_mesh_read(dm_context *context, const char *path, const char *unit, uint32_t flags, dm_handle *mesh);

// Copies the corners as they were prepared, mm: rows of x, y, z. n and needed count numbers, three of a corner.
dm_status dm_mesh_vertices(dm_context *context, dm_handle mesh, double *buffer, size_t n, size_t *needed);

// Copies the triangles as they were prepared: rows of three corners. n and needed count numbers, three of a triangle.
dm_status dm_mesh_triangles(dm_context *context, dm_handle mesh, uint32_t *buffer, size_t n, size_t *needed);

// The origin of the mesh's coordinates in those that were given, three numbers, mm: DM_NOT_COMPUTED if they are the
// same. They differ of a part that is far from the origin.
dm_status dm_mesh_origin(dm_context *context, dm_handle mesh, double *origin_mm);

// Copies what was changed of the mesh or left out, a line each.
dm_status dm_mesh_notices(dm_context *context, dm_handle mesh, char *buffer, size_t n, size_t *needed);

// Makes an empty list of tools.
dm_status dm_tools_new(dm_context *context, dm_handle *tools);

// Adds a ball end: cutter radius, height of its cylinder from 2 CR above the tip to the holder, radius and height of
// the holder, and a margin about what does not cut, mm. Above the holder everything is spindle.
dm_status dm_tools_add_ball_end(dm_context *context,
                                dm_handle tools,
                                double cr_mm,
                                double ch_mm,
                                double fr_mm,
                                double fh_mm,
                                double clearance_mm);

// Adds a flat end, of the lengths of dm_tools_add_ball_end.
dm_status dm_tools_add_flat_end(dm_context *context,
                                dm_handle tools,
                                double cr_mm,
                                double ch_mm,
                                double fr_mm,
                                double fh_mm,
                                double clearance_mm);

// Adds a bull nose, whose tip has a corner of this radius: 0 is a flat end, CR a ball end.
dm_status dm_tools_add_bull_nose(dm_context *context,
                                 dm_handle tools,
                                 double cr_mm,
                                 double ch_mm,
                                 double fr_mm,
                                 double fh_mm,
                                 double corner_mm,
                                 double clearance_mm);

// Adds a ball end in the words of the program: "CR,CH,FR,FH", mm.
dm_status dm_tools_add_text(dm_context *context, dm_handle tools, const char *lengths);

// Adds the tools of a file or folder: a Fusion 360 library, FreeCAD, CAMotics, LinuxCNC, HSMWorks, or a CSV table.
//
// unit: that of the file's numbers; null is as the file states. stick_out_mm: of tools whose file states none, 0 if
// it is not known. What is left out is in dm_tools_notices.
dm_status dm_tools_add_file(dm_context *context,
                            dm_handle tools,
                            const char *path,
                            const char *unit,
                            double stick_out_mm);

// Has a tool of the list leave stock of this thickness, mm.
dm_status dm_tools_set_allowance(dm_context *context, dm_handle tools, uint32_t tool, double allowance_mm);

// Names a tool of the list, for files and tables.
dm_status dm_tools_set_name(dm_context *context, dm_handle tools, uint32_t tool, const char *name);

// The number of tools in the list.
dm_status dm_tools_count(dm_context *context, dm_handle tools, size_t *n_tools);

// Copies the name of a tool of the list, a colon, and the tool in words.
dm_status dm_tools_words(dm_context *context, dm_handle tools, uint32_t tool, char *buffer, size_t n, size_t *needed);

// Copies what was left out of tool files or changed, a line each.
dm_status dm_tools_notices(dm_context *context, dm_handle tools, char *buffer, size_t n, size_t *needed);

// Makes an analysis of a mesh and tools, with the options of `deepmill label`: 7,000 sites, 150 directions over the
// upper half, the mesh definition. Tools that are added to the list later are not in it.
dm_status dm_analysis_new(dm_context *context, dm_handle mesh, dm_handle tools, dm_handle *analysis);

// Names the part, for files and titles; "part" if it has no file.
dm_status dm_analysis_set_name(dm_context *context, dm_handle analysis, const char *name);

// Spreads about so many sites over the surface; the seed is that of their places.
dm_status dm_analysis_set_sites(dm_context *context, dm_handle analysis, size_t n_sites, uint64_t seed);

// Takes the corners of the mesh as its sites.
dm_status dm_analysis_set_sites_at_vertices(dm_context *context, dm_handle analysis);

// Has normals be smooth across edges that are folded by less than this angle, of 0 to 180 degrees.
dm_status dm_analysis_set_smooth(dm_context *context, dm_handle analysis, double degrees);

// The directions tested: a number of them over the upper half, or a set such as "cone:60:150", "sphere:300" or "up".
dm_status dm_analysis_set_directions(dm_context *context, dm_handle analysis, const char *directions);

// The directions tested: rows of x, y, z from tip to spindle, of any length above 0.
dm_status dm_analysis_set_direction_vectors(dm_context *context,
                                            dm_handle analysis,
                                            const double *vectors,
                                            size_t n_vectors);

// Gouge tolerance against every facet, mm, in place of one that the facets imply.
dm_status dm_analysis_set_tolerance(dm_context *context, dm_handle analysis, double tolerance_mm);

// How much may remain at a site that counts as reached, mm.
dm_status dm_analysis_set_finish(dm_context *context, dm_handle analysis, double finish_mm);

// How many cells between the directions are searched for each site, 0 for none.
dm_status dm_analysis_set_search(dm_context *context, dm_handle analysis, size_t n_kept);

// Searches far longer between the directions, for proofs that nothing is open.
dm_status dm_analysis_set_prove(dm_context *context, dm_handle analysis);

// Also marks this share of the sites, those that are most often in the way.
dm_status dm_analysis_set_occlusion(dm_context *context, dm_handle analysis, double share);

// Also computes by how much every height and radius of a tool may grow or must shrink, up to this, mm.
dm_status dm_analysis_set_clearance_limit(dm_context *context, dm_handle analysis, double limit_mm);

// Also computes how much each tool leaves where it does not reach, unless `rest` is 0.
dm_status dm_analysis_set_rest(dm_context *context, dm_handle analysis, int rest);

// Adds a mesh that blocks too, in the coordinates of the part as it was given. name: for findings; null is its file's.
dm_status dm_analysis_add_fixture(dm_context *context, dm_handle analysis, dm_handle mesh, const char *name);

// Puts a table at this height, which blocks too, in the coordinates of the part as it was given, mm.
dm_status dm_analysis_set_table(dm_context *context, dm_handle analysis, double z_mm);

// The number of threads that compute; 0, the default, is one per logical CPU. Results do not depend on it.
dm_status dm_analysis_set_threads(dm_context *context, dm_handle analysis, size_t n_threads);

// Places the sites and labels them for every tool. progress: may be null; user: is handed to it as it is.
dm_status dm_analysis_run(dm_context *context,
                          dm_handle analysis,
                          dm_progress progress,
                          void *user,
                          dm_handle *outcome);

// The numbers of sites, tools and directions. Each of the places may be null.
dm_status dm_outcome_counts(dm_context *context,
                            dm_handle outcome,
                            size_t *n_sites,
                            size_t *n_tools,
                            size_t *n_directions);

// Copies numbers of type float: DM_POINTS and so on. tool: from 0 on; DM_ALL_TOOLS for what no tool reaches, of
// DM_REST_MM and DM_REST_VOLUME_MM3.
dm_status dm_outcome_floats(dm_context *context,
                            dm_handle outcome,
                            uint32_t tool,
                            uint32_t field,
                            float *buffer,
                            size_t n,
                            size_t *needed);

// Copies numbers of type double: DM_AREA_SHARES and so on.
dm_status dm_outcome_doubles(dm_context *context,
                             dm_handle outcome,
                             uint32_t tool,
                             uint32_t field,
                             double *buffer,
                             size_t n,
                             size_t *needed);

// Copies numbers of type uint32_t: DM_FACES and so on. tool: from 0 on; DM_ALL_TOOLS for what no tool reaches, of
// DM_FINDING_OF_SITE.
dm_status dm_outcome_uint32s(dm_context *context,
                             dm_handle outcome,
                             uint32_t tool,
                             uint32_t field,
                             uint32_t *buffer,
                             size_t n,
                             size_t *needed);

// Copies numbers of type uint8_t: DM_ANSWERS or DM_OCCLUSION. tool: from 0 on; DM_ALL_TOOLS for what no tool reaches,
// of DM_ANSWERS.
dm_status dm_outcome_bytes(dm_context *context,
                           dm_handle outcome,
                           uint32_t tool,
                           uint32_t field,
                           uint8_t *buffer,
                           size_t n,
                           size_t *needed);

// Copies text: DM_TOOL_NAME and so on. tool: from 0 on; DM_ALL_TOOLS of DM_WARNINGS for all of them, of
// DM_FINDINGS_JSON for what no tool reaches.
dm_status dm_outcome_text(dm_context *context,
                          dm_handle outcome,
                          uint32_t tool,
                          uint32_t field,
                          char *buffer,
                          size_t n,
                          size_t *needed);

// Share of the surface that has an answer, DM_ACCESSIBLE and so on. tool: from 0 on, or DM_ALL_TOOLS.
dm_status dm_outcome_share(dm_context *context, dm_handle outcome, uint32_t tool, uint32_t answer, double *share);

// Area of the surface, mm².
dm_status dm_outcome_surface(dm_context *context, dm_handle outcome, double *surface_mm2);

// Number of regions out of reach of a tool, or with DM_ALL_TOOLS of all.
dm_status dm_outcome_n_findings(dm_context *context, dm_handle outcome, uint32_t tool, size_t *n_findings);

// A region out of reach, by its number from 0 on; the largest is first.
dm_status dm_outcome_finding(dm_context *context, dm_handle outcome, uint32_t tool, size_t number, dm_finding *finding);

// Copies the name of a region, which other sites and small changes of the part do not change.
dm_status dm_outcome_finding_id(dm_context *context,
                                dm_handle outcome,
                                uint32_t tool,
                                size_t number,
                                char *buffer,
                                size_t n,
                                size_t *needed);

// Writes the folder of `deepmill label`. unit: of tables and report; null is mm. flags: 0, or DM_WRITE_REPORT and so
// on. progress and user: as of dm_analysis_run.
dm_status dm_outcome_write(dm_context *context,
                           dm_handle outcome,
                           const char *folder,
                           const char *unit,
                           uint32_t flags,
                           dm_progress progress,
                           void *user);

// Writes the HTML report into one file. unit: of lengths and areas; null is mm.
dm_status dm_outcome_write_report(dm_context *context, dm_handle outcome, const char *path, const char *unit);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* DEEPMILL_H */
