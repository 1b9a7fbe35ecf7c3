// A humanoid avatar steered by motet's live server: motet live --port 8765 (docs/reference/live-protocol.md has the protocol).
// Put it on the avatar, which has an Animator of the type Humanoid without a controller and starts in its T-pose.
// Needs the package com.unity.nuget.newtonsoft-json.
using System;
using System.Collections.Generic;
using System.IO;
using System.Net.WebSockets;
using System.Text;
using System.Threading;
using System.Threading.Tasks;
using Newtonsoft.Json.Linq;
using UnityEngine;

public class MotetFigure : MonoBehaviour
{
    public string url = "ws://127.0.0.1:8765";
    public float speed = 1.3f; // metres a second of a stick that is pushed all the way
    ClientWebSocket socket = new ClientWebSocket();
    List<Transform> bones = new List<Transform>(); // of the avatar, null where it has none
    List<int> parents = new List<int>(); // of each bone among them
    List<Quaternion> rests = new List<Quaternion>(); // in the T-pose, from the frame of the figure
    Task sent = Task.CompletedTask;
    float size = 1, x, z;

    async void Start()
    {
        await socket.ConnectAsync(new Uri(url), CancellationToken.None);
        var part = new ArraySegment<byte>(new byte[1 << 16]);
        for (var text = new MemoryStream(); socket.State == WebSocketState.Open;)
        {
            var got = await socket.ReceiveAsync(part, CancellationToken.None);
            text.Write(part.Array, 0, got.Count);
            if (!got.EndOfMessage) continue;
            if (text.Length > 0) Take(JObject.Parse(Encoding.UTF8.GetString(text.ToArray())));
            text.SetLength(0);
        }
    }

    void Take(JObject message)
    {
        var type = (string)message["type"];
        if (type == "hello") Meet(message);
        else if (type == "frame") Pose(message["characters"][0]);
        else Debug.LogWarning(message["message"]); // a note, or why the server hangs up
    }

    void Meet(JObject hello)
    {
        var names = hello["bones"].ToObject<List<string>>();
        foreach (var joint in hello["joints"])
        {
            var name = (string)joint["name"];
            if (!names.Contains(name)) continue; // the tip of a bone
            var bone = (HumanBodyBones)Enum.Parse(typeof(HumanBodyBones), name, true);
            bones.Add(GetComponent<Animator>().GetBoneTransform(bone));
            var parent = (int)joint["parent"];
            parents.Add(parent < 0 ? -1 : names.IndexOf((string)hello["joints"][parent]["name"]));
            var last = bones[bones.Count - 1];
            rests.Add(last ? Quaternion.Inverse(transform.rotation) * last.rotation : Quaternion.identity);
        }
        size = (bones[0].position.y - transform.position.y) / (float)hello["joints"][0]["offset"][1];
    }

    void Pose(JToken figure)
    {
        transform.SetPositionAndRotation(Vector(figure["position"]) * size, Turn(figure["rotation"]));
        var turns = new List<Quaternion>();
        for (var i = 0; i < bones.Count; i++)
        {
            turns.Add((i == 0 ? transform.rotation : turns[parents[i]]) * Turn(figure["rotations"][i]));
            if (bones[i]) bones[i].rotation = turns[i] * rests[i];
        }
        bones[0].position = transform.position + Vector3.up * ((float)figure["height"] * size);
    }

    void Update()
    {
        float right = Input.GetAxisRaw("Horizontal") * speed, ahead = Input.GetAxisRaw("Vertical") * speed;
        if (socket.State != WebSocketState.Open || !sent.IsCompleted || (right == x && ahead == z)) return;
        (x, z) = (right, ahead);
        FormattableString said = $"{{\"type\":\"control\",\"velocity\":[{-right},{ahead}]}}"; // x is to the left
        var bytes = new ArraySegment<byte>(Encoding.UTF8.GetBytes(FormattableString.Invariant(said)));
        sent = socket.SendAsync(bytes, WebSocketMessageType.Text, true, CancellationToken.None);
    }

    void OnDestroy() => socket.Dispose();

    // Unity's axes are left-handed: x is mirrored.
    static Vector3 Vector(JToken v) => new Vector3(-(float)v[0], (float)v[1], (float)v[2]);

    static Quaternion Turn(JToken q) => new Quaternion((float)q[0], -(float)q[1], -(float)q[2], (float)q[3]);
}
