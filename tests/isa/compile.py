"""Compiles kernels for an AMD device that is not there. Prints statistics as JSON, and programs where RADV_DEBUG has `shaders`.

    VK_DRIVER_FILES=…/radeon_icd.x86_64.json RADV_FORCE_FAMILY=navi21 RADV_DEBUG=shaders,nocache \\
        python3 compile.py KERNEL.spv …

Mesa's RADV opens a device of the family that the variable names, which compiles and never runs. A kernel's file has the name of
its entry point; a word may follow behind a dot. Needs the package `vulkan`.
"""

import json
import struct
import sys
from pathlib import Path

import vulkan as vk
from vulkan import ffi

EXTENSION = "VK_KHR_pipeline_executable_properties"
# The driver keeps statistics.
CAPTURE = 0x40
DECORATE, VARIABLE, BINDING, UNIFORM = 71, 59, 33, 2


def text(value) -> str:
    return value if isinstance(value, str) else ffi.string(value).decode()


def bindings(code: bytes) -> dict[int, int]:
    """Kinds of the buffers of a SPIR-V module by their numbers."""
    words = struct.unpack(f"<{len(code) // 4}I", code)
    numbers, classes, at = {}, {}, 5
    while at < len(words):
        length, operation = words[at] >> 16, words[at] & 0xFFFF
        if operation == DECORATE and words[at + 2] == BINDING:
            numbers[words[at + 1]] = words[at + 3]
        if operation == VARIABLE:
            classes[words[at + 2]] = words[at + 3]
        at += length
    kinds = [vk.VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, vk.VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER]
    return {number: kinds[classes[name] == UNIFORM] for name, number in numbers.items()}


def opened():
    """The only device."""
    app = vk.VkApplicationInfo(apiVersion=vk.VK_MAKE_VERSION(1, 2, 0))
    instance = vk.vkCreateInstance(vk.VkInstanceCreateInfo(pApplicationInfo=app), None)
    chip = vk.vkEnumeratePhysicalDevices(instance)[0]
    queue = vk.VkDeviceQueueCreateInfo(queueFamilyIndex=0, queueCount=1, pQueuePriorities=[1.0])
    wanted = vk.VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR(pipelineExecutableInfo=1)
    create = vk.VkDeviceCreateInfo(
        pNext=wanted, queueCreateInfoCount=1, pQueueCreateInfos=[queue],
        enabledExtensionCount=1, ppEnabledExtensionNames=[EXTENSION])
    return vk.vkCreateDevice(chip, create, None)


def compiled(device, file: Path) -> dict:
    """Statistics of a kernel."""
    code = file.read_bytes()
    module = vk.vkCreateShaderModule(device, vk.VkShaderModuleCreateInfo(codeSize=len(code), pCode=code), None)
    slots = [
        vk.VkDescriptorSetLayoutBinding(
            binding=number, descriptorType=kind, descriptorCount=1, stageFlags=vk.VK_SHADER_STAGE_COMPUTE_BIT)
        for number, kind in bindings(code).items()]
    slots = vk.VkDescriptorSetLayoutCreateInfo(bindingCount=len(slots), pBindings=slots)
    slots = vk.vkCreateDescriptorSetLayout(device, slots, None)
    layout = vk.VkPipelineLayoutCreateInfo(setLayoutCount=1, pSetLayouts=[slots])
    layout = vk.vkCreatePipelineLayout(device, layout, None)
    stage = vk.VkPipelineShaderStageCreateInfo(
        stage=vk.VK_SHADER_STAGE_COMPUTE_BIT, module=module, pName=file.stem.split(".")[0])
    create = vk.VkComputePipelineCreateInfo(flags=CAPTURE, stage=stage, layout=layout)
    # Whatever the driver says from here on is of this kernel.
    print(f"KERNEL {file.stem}", file=sys.stderr, flush=True)
    pipeline = vk.vkCreateComputePipelines(device, None, 1, [create], None)[0]
    info = vk.VkPipelineExecutableInfoKHR(pipeline=pipeline, executableIndex=0)
    statistics = vk.vkGetDeviceProcAddr(device, "vkGetPipelineExecutableStatisticsKHR")(device, info)
    return {text(row.name): row.value.u64 for row in statistics}


device = opened()
print(json.dumps({Path(file).stem: compiled(device, Path(file)) for file in sys.argv[1:]}))
