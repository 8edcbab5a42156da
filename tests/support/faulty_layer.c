/* A Vulkan layer whose device computes wrong, crashes, runs out of memory or is lost, for
 * tests/device_faults.rs.
 *
 * FAULTY_BYTES: allocations that exceed this many bytes together fail.
 * FAULTY_SUBMISSION: this submission, counted from 1, and all after it find the device lost.
 * FAULTY_CRASH: the process crashes at this submission, counted from 1.
 * FAULTY_OPCODE: instructions of SPIR-V with this number have no result.
 * FAULTY_PRESENT: this picture for a window, counted from 1, finds the surface lost, and says so.
 * FAULTY_WAITS: so many waits for a fence, counted from the first, time out.
 *
 * One instance and one device. The few types of the loader's interface are declared here, so that
 * the test needs no headers of Vulkan. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

enum { SURFACE_LOST = -1000000000, TIMEOUT = 2 };
enum { OUT_OF_DEVICE_MEMORY = -2, DEVICE_LOST = -4, INITIALIZATION_FAILED = -3 };
enum { UNDEFINED = 3 << 16 | 1, NOTHING = 1 << 16, FIRST_INSTRUCTION = 5 };
enum { INSTANCE_CHAIN = 47, DEVICE_CHAIN = 48, LAYER_LINK = 0 };

typedef void (*Function)(void);
typedef Function (*GetAddress)(void *object, const char *name);

typedef struct Link {
    struct Link *next;
    GetAddress instance_address;
    GetAddress other_address; /* of the physical device or of the device */
} Link;

/* The start of every create info, and of the loader's element in its chain. */
typedef struct Chain {
    uint32_t type;
    struct Chain *next;
    uint32_t function;
    Link *link;
} Chain;

typedef struct {
    uint32_t type;
    void *next;
    uint64_t size;
} AllocateInfo;

typedef struct {
    uint32_t type;
    const void *next;
    uint32_t flags;
    size_t size;
    const uint32_t *code;
} ModuleInfo;

typedef struct {
    uint32_t type;
    void *next;
    uint32_t version;
    GetAddress instance_address, device_address, physical_device_address;
} Negotiation;

static void *instance;
static GetAddress next_instance_address, next_device_address;
static uint64_t allocated_bytes, presents, submissions, waits;
static struct { void *memory; uint64_t size; } live[1024];

static uint64_t setting(const char *name)
{
    const char *text = getenv(name);
    return text ? strtoull(text, NULL, 10) : UINT64_MAX;
}

static Chain *find_link(const void *info, uint32_t type)
{
    Chain *chain = ((const Chain *)info)->next;
    while (chain && (chain->type != type || chain->function != LAYER_LINK)) chain = chain->next;
    return chain;
}

static int32_t create_instance(const void *info, const void *allocator, void **created)
{
    Chain *chain = find_link(info, INSTANCE_CHAIN);
    if (!chain) return INITIALIZATION_FAILED;
    next_instance_address = chain->link->instance_address;
    chain->link = chain->link->next;
    int32_t (*create)(const void *, const void *, void **) =
        (void *)next_instance_address(NULL, "vkCreateInstance");
    int32_t result = create(info, allocator, created);
    instance = *created;
    return result;
}

static int32_t create_device(void *physical, const void *info, const void *allocator, void **created)
{
    Chain *chain = find_link(info, DEVICE_CHAIN);
    if (!chain) return INITIALIZATION_FAILED;
    next_device_address = chain->link->other_address;
    int32_t (*create)(void *, const void *, const void *, void **) =
        (void *)chain->link->instance_address(instance, "vkCreateDevice");
    chain->link = chain->link->next;
    return create(physical, info, allocator, created);
}

static int32_t allocate(void *device, const AllocateInfo *info, const void *allocator, void **memory)
{
    if (info->size > setting("FAULTY_BYTES") - allocated_bytes) return OUT_OF_DEVICE_MEMORY;
    int32_t (*next)(void *, const AllocateInfo *, const void *, void **) =
        (void *)next_device_address(device, "vkAllocateMemory");
    int32_t result = next(device, info, allocator, memory);
    for (size_t i = 0; result == 0 && i < sizeof live / sizeof *live; ++i) {
        if (live[i].memory) continue;
        live[i].memory = *memory;
        live[i].size = info->size;
        allocated_bytes += info->size;
        break;
    }
    return result;
}

static void release(void *device, void *memory, const void *allocator)
{
    for (size_t i = 0; memory && i < sizeof live / sizeof *live; ++i) {
        if (live[i].memory != memory) continue;
        allocated_bytes -= live[i].size;
        live[i].memory = NULL;
        break;
    }
    void (*next)(void *, void *, const void *) = (void *)next_device_address(device, "vkFreeMemory");
    next(device, memory, allocator);
}

/* Leaves the type and name of every result of the instruction, and nothing that computes it. */
static int32_t create_module(void *device, const ModuleInfo *info, const void *allocator, void **module)
{
    int32_t (*next)(void *, const ModuleInfo *, const void *, void **) =
        (void *)next_device_address(device, "vkCreateShaderModule");
    uint32_t *code = malloc(info->size);
    memcpy(code, info->code, info->size);
    for (size_t at = FIRST_INSTRUCTION, length; at < info->size / sizeof *code; at += length) {
        length = code[at] >> 16;
        if ((code[at] & 0xffff) != setting("FAULTY_OPCODE")) continue;
        code[at] = UNDEFINED;
        for (size_t word = UNDEFINED >> 16; word < length; ++word) code[at + word] = NOTHING;
    }
    ModuleInfo changed = *info;
    changed.code = code;
    int32_t result = next(device, &changed, allocator, module);
    free(code);
    return result;
}

/* The queue has no address of its own to look names up with: its device keeps it. */
static int32_t (*next_submit)(void *, uint32_t, const void *, void *);

static int32_t submit(void *queue, uint32_t count, const void *infos, void *fence)
{
    if (++submissions >= setting("FAULTY_SUBMISSION")) return DEVICE_LOST;
    if (submissions == setting("FAULTY_CRASH")) abort();
    return next_submit(queue, count, infos, fence);
}

static int32_t (*next_present)(void *, const void *);

static int32_t present(void *queue, const void *info)
{
    if (++presents != setting("FAULTY_PRESENT")) return next_present(queue, info);
    fputs("the layer loses the surface\n", stderr);
    return SURFACE_LOST;
}

static int32_t (*next_wait)(void *, uint32_t, const void *, uint32_t, uint64_t);

static int32_t wait_for_fences(void *device, uint32_t count, const void *fences, uint32_t all,
                               uint64_t timeout)
{
    const uint64_t late = setting("FAULTY_WAITS");
    int32_t result = next_wait(device, count, fences, all, timeout);
    return late != UINT64_MAX && ++waits <= late ? TIMEOUT : result;
}

static Function device_address(void *device, const char *name)
{
    if (!strcmp(name, "vkGetDeviceProcAddr")) return (Function)device_address;
    if (!strcmp(name, "vkAllocateMemory")) return (Function)allocate;
    if (!strcmp(name, "vkFreeMemory")) return (Function)release;
    if (!strcmp(name, "vkCreateShaderModule")) return (Function)create_module;
    Function next = next_device_address(device, name);
    if (!strcmp(name, "vkQueuePresentKHR")) {
        next_present = (void *)next;
        return (Function)present;
    }
    if (!strcmp(name, "vkWaitForFences")) {
        next_wait = (void *)next;
        return (Function)wait_for_fences;
    }
    if (strcmp(name, "vkQueueSubmit")) return next;
    next_submit = (void *)next;
    return (Function)submit;
}

static Function instance_address(void *of, const char *name)
{
    if (!strcmp(name, "vkGetInstanceProcAddr")) return (Function)instance_address;
    if (!strcmp(name, "vkGetDeviceProcAddr")) return (Function)device_address;
    if (!strcmp(name, "vkCreateInstance")) return (Function)create_instance;
    if (!strcmp(name, "vkCreateDevice")) return (Function)create_device;
    return next_instance_address(of, name);
}

EXPORT int32_t vkNegotiateLoaderLayerInterfaceVersion(Negotiation *negotiation)
{
    negotiation->version = 2;
    negotiation->instance_address = instance_address;
    negotiation->device_address = device_address;
    negotiation->physical_device_address = NULL;
    return 0;
}
