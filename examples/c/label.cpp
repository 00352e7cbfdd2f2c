// Labels a part in C++: handles that free themselves, failures as exceptions, and work that a callback stops.
//
// `label` labels a block of 40 x 30 x 20 mm and compares with the answer computed by hand; `label PART.stl` labels a
// file. docs/c.md says how to build it.
#include "deepmill.h"

#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

struct Failure : std::runtime_error {
    dm_status status;
    Failure(dm_status of, const std::string &text) : std::runtime_error(text), status(of) {}
};

class Context {
public:
    Context() : context(dm_context_new(DM_ABI_VERSION))
    {
        if (context == nullptr) {
            throw std::runtime_error("the library has another ABI version than the header");
        }
    }
    ~Context() { dm_context_free(&context); }
    Context(const Context &) = delete;
    Context &operator=(const Context &) = delete;

    dm_context *get() const { return context; }

    // Throws if a call has failed.
    void require(dm_status status) const
    {
        if (status == DM_OK) {
            return;
        }
        size_t needed = 0;
        dm_error_text(context, nullptr, 0, &needed);
        std::vector<char> text(needed);
        dm_error_text(context, text.data(), text.size(), nullptr);
        throw Failure(status, text.data());
    }

private:
    dm_context *context;
};

// An object that frees itself before its context does.
class Object {
public:
    explicit Object(const Context &of) : context(of) {}
    ~Object() { dm_free(context.get(), handle); }
    Object(const Object &) = delete;
    Object &operator=(const Object &) = delete;

    dm_handle *place() { return &handle; }
    dm_handle get() const { return handle; }

private:
    const Context &context;
    dm_handle handle = 0;
};

// Numbers of an outcome, by one of the functions that copy them.
template <typename T>
std::vector<T> numbers(const Context &context, const Object &outcome, uint32_t field,
                       dm_status (*copy)(dm_context *, dm_handle, uint32_t, uint32_t, T *, size_t, size_t *))
{
    size_t needed = 0;
    context.require(copy(context.get(), outcome.get(), 0, field, nullptr, 0, &needed));
    std::vector<T> all(needed);
    context.require(copy(context.get(), outcome.get(), 0, field, all.data(), all.size(), nullptr));
    return all;
}

int stop(void *user, uint32_t stage, size_t, size_t) noexcept
{
    *static_cast<uint32_t *>(user) = stage;
    return 1;
}

void block(const Context &context, Object &mesh)
{
    const std::vector<double> corners = {0, 0, 0,  40, 0, 0,  40, 30, 0,  0, 30, 0,
                                         0, 0, 20, 40, 0, 20, 40, 30, 20, 0, 30, 20};
    const std::vector<uint32_t> triangles = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                             1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7};
    context.require(dm_mesh_new(context.get(), corners.data(), corners.size() / 3, triangles.data(),
                                triangles.size() / 3, nullptr, 0, mesh.place()));
}

// From above the flat end reaches all but the underside: its holder begins 26 mm above the tip.
bool is_right(const std::vector<float> &normals, const std::vector<uint8_t> &answers)
{
    for (size_t i = 0; i < answers.size(); i++) {
        const bool is_underside = normals[3 * i + 2] < -0.5f;
        if (answers[i] != (is_underside ? DM_INACCESSIBLE : DM_ACCESSIBLE)) {
            return false;
        }
    }
    return !answers.empty();
}

int run(const char *path)
{
    const Context context;
    Object mesh(context), tools(context), analysis(context), outcome(context);
    if (path != nullptr) {
        context.require(dm_mesh_read(context.get(), path, nullptr, 0, mesh.place()));
    } else {
        block(context, mesh);
    }
    context.require(dm_tools_new(context.get(), tools.place()));
    context.require(dm_tools_add_flat_end(context.get(), tools.get(), 3, 20, 20, 20, 0));
    context.require(dm_analysis_new(context.get(), mesh.get(), tools.get(), analysis.place()));
    context.require(dm_analysis_set_sites(context.get(), analysis.get(), 1000, 0));
    context.require(dm_analysis_set_directions(context.get(), analysis.get(), "up"));
    context.require(dm_analysis_set_search(context.get(), analysis.get(), 0));

    uint32_t stage = DM_STAGE_WRITING;
    try {
        context.require(dm_analysis_run(context.get(), analysis.get(), stop, &stage, outcome.place()));
        return 1;
    } catch (const Failure &failure) {
        std::printf("stopped: %s\n", failure.what());
        if (failure.status != DM_INTERRUPTED || stage != DM_STAGE_SITES || outcome.get() != 0) {
            return 1;
        }
    }
    context.require(dm_analysis_run(context.get(), analysis.get(), nullptr, nullptr, outcome.place()));
    const auto normals = numbers<float>(context, outcome, DM_NORMALS, dm_outcome_floats);
    const auto answers = numbers<uint8_t>(context, outcome, DM_ANSWERS, dm_outcome_bytes);
    double share = 0;
    context.require(dm_outcome_share(context.get(), outcome.get(), 0, DM_ACCESSIBLE, &share));
    std::printf("%zu sites, %.1f %% of the surface within reach\n", answers.size(), 100 * share);
    // 4000 of 5200 mm2.
    return path != nullptr || (is_right(normals, answers) && std::fabs(share - 4000.0 / 5200.0) < 0.02) ? 0 : 1;
}

} // namespace

int main(int n_arguments, char **arguments)
{
    try {
        return run(n_arguments > 1 ? arguments[1] : nullptr);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}
