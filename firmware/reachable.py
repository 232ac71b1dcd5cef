"""Bytes of the functions that can be reached from one, by a program's disassembly: reachable.py PROGRAM NAME [OBJDUMP]"""
import re
import subprocess
import sys

program, name = sys.argv[1:3]
objdump = sys.argv[3] if len(sys.argv) > 3 else "llvm-objdump"
text = subprocess.run([objdump, "-d", "--no-show-raw-insn", program], capture_output=True, text=True, check=True).stdout
sizes, calls, function = {}, {}, None
for line in text.splitlines():
    head = re.match(r"([0-9a-f]+) <(.*)>:$", line)
    if head:
        function, start = head.group(2), int(head.group(1), 16)
        calls[function] = set()
        sizes[function] = (start, start)
        continue
    body = re.match(r"\s*([0-9a-f]+):\s+\S+\s*(.*)", line)
    if body and function:
        sizes[function] = (sizes[function][0], int(body.group(1), 16) + 4)
        # A branch into another function, not only a call: tail calls and shared ends.
        calls[function].update(target for target in re.findall(r"<([^>+]*)", body.group(2)) if target != function)
starts = [function for function in calls if name in function]
reached, todo = set(), list(starts)
while todo:
    function = todo.pop()
    if function in calls and function not in reached:
        reached.add(function)
        todo.extend(calls[function])
print(sum(sizes[function][1] - sizes[function][0] for function in reached), len(reached))
